#include <algorithm>
#include <iterator>

#include <OpenImageIO/strutil.h>

#include "parts.h"

namespace twincast::oiio {

namespace {

std::unique_ptr<OIIO::ImageInput> reader(const std::string& path, const std::string& format)
{
    // Without the path: given that, OpenImageIO would try its other readers as well.
    auto file = OIIO::ImageInput::create(format);
    if (!file)
        fail(OIIO::geterror(), "not an image that OpenImageIO reads");
    // Straight alpha as it is: OpenImageIO would multiply encoded colours by it.
    OIIO::ImageSpec wishes;
    wishes.attribute("oiio:UnassociatedAlpha", 1);
    OIIO::ImageSpec found;
    if (!file->open(path, found, wishes))
        fail(file, "not an image that OpenImageIO reads");
    return file;
}

// The values of an attribute, where it has this type; they are the file's.
template<typename T> Slice<T> values(const OIIO::ImageSpec& spec, const char* name, OIIO::TypeDesc type, size_t count)
{
    auto* attribute = spec.find_attribute(name, type);
    return attribute ? Slice<T> { static_cast<const T*>(attribute->data()), count } : Slice<T> { nullptr, 0 };
}

}  // namespace

Input::Input(const std::string& path, const std::string& format)
    : file(reader(path, format))
{
}

std::vector<int> Input::picked() const
{
    const OIIO::ImageSpec& spec = file->spec();
    std::vector<int> picked;
    const std::string format = file->format_name();
    // OpenImageIO's reader writes past its memory where there are tiles of these (its issue 5315).
    if (format == "tiff" && spec.get_int_attribute("tiff:PhotometricInterpretation") == 5
        && spec.get_int_attribute("oiio:BitsPerSample", 8) < 8)
        throw std::runtime_error("CMYK of less than 8 bits, which is not read");
    if (format != "openexr") {
        // Colours come first, and alpha after them.
        const int colours = spec.nchannels < 3 ? 1 : 3;
        const bool alpha  = spec.nchannels > colours && spec.alpha_channel == colours;
        for (int i = 0; i < colours + alpha; ++i)
            picked.push_back(i);
        return picked;
    }
    // Channels have names, and any order.
    auto find = [&](const char* name) {
        auto& names = spec.channelnames;
        auto found  = std::find(names.begin(), names.end(), name);
        return found == names.end() ? -1 : int(found - names.begin());
    };
    const int r = find("R"), g = find("G"), b = find("B"), y = find("Y"), a = find("A");
    if (r >= 0 && g >= 0 && b >= 0)
        picked = { r, g, b };
    else if (y >= 0)
        picked = { y };
    else if (spec.nchannels == 1)
        picked = { 0 };
    else
        throw std::runtime_error("no channels R, G and B, or Y; it has " + OIIO::Strutil::join(spec.channelnames, ", "));
    for (int channel : picked)
        if (!spec.channelformat(channel).is_floating_point())
            throw std::runtime_error("colours of whole numbers; only floating values are read");
    if (a >= 0)
        picked.push_back(a);
    return picked;
}

void Input::size(uint32_t* width_and_height) const
{
    const OIIO::ImageSpec& spec = file->spec();
    if (spec.deep || spec.depth > 1)
        throw std::runtime_error("a deep or volume image; only flat ones are read");
    if (spec.width < 0 || spec.height < 0 || spec.nchannels < 1)
        throw std::runtime_error("an image without pixels");
    width_and_height[0] = uint32_t(spec.width);
    width_and_height[1] = uint32_t(spec.height);
}

Layout Input::layout() const
{
    uint32_t width_and_height[2];
    size(width_and_height);
    const OIIO::ImageSpec& spec = file->spec();

    Layout layout {};
    layout.width  = width_and_height[0];
    layout.height = width_and_height[1];
    const std::vector<int> channels = picked();

    layout.channels = uint32_t(channels.size());
    layout.alpha    = channels.size() % 2 == 0;
    layout.straight = spec.get_int_attribute("oiio:UnassociatedAlpha") != 0;
    // Of the colours: channels may be of several types.
    const OIIO::TypeDesc format = spec.channelformat(channels.front());
    layout.kind                 = format == OIIO::TypeDesc::UINT8  ? Kind::U8
                                  : format.is_floating_point()     ? Kind::Float
                                                                   : Kind::U16;
    layout.orientation = uint32_t(spec.get_int_attribute("Orientation", 1));
    const int32_t window[] { spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height };
    std::copy(std::begin(window), std::end(window), layout.window);
    return layout;
}

Attributes Input::attributes()
{
    const OIIO::ImageSpec& spec = file->spec();
    strings.clear();
    texts.clear();
    window.clear();
    auto keep = [&](std::string text) { return bytes(strings.emplace_back(std::move(text))); };

    Attributes found {};
    found.software            = keep(std::string(spec.get_string_attribute("Software")));
    found.world_to_camera     = values<float>(spec, "worldtocamera", OIIO::TypeMatrix, 16);
    found.world_to_screen     = values<float>(spec, "worldtoscreen", OIIO::TypeMatrix, 16);
    found.fovcot              = values<float>(spec, "fovcot", OIIO::TypeFloat, 1);
    found.render_time_seconds = values<float>(spec, "renderTimeSeconds", OIIO::TypeFloat, 1);
    found.samples_per_pixel   = values<int32_t>(spec, "samplesPerPixel", OIIO::TypeInt, 1);
    const bool whole = spec.x == 0 && spec.y == 0 && spec.full_width == spec.width && spec.full_height == spec.height;
    if (!whole && spec.full_x == 0 && spec.full_y == 0)
        window = { spec.x, spec.y, spec.full_width, spec.full_height };
    found.window = { window.data(), window.size() };
    for (auto& attribute : spec.extra_attribs)
        if (attribute.type() == OIIO::TypeString)
            texts.push_back({ keep(attribute.name().string()), keep(attribute.get_string()) });
    found.texts = { texts.data(), texts.size() };
    return found;
}

void Input::read(uint8_t* samples, size_t length) const
{
    const Layout expected = layout();
    check_length(expected, length);
    const std::vector<int> channels = picked();
    const OIIO::TypeDesc type       = type_of(expected.kind);
    const size_t pixel              = channels.size() * type.size();
    // What lies side by side in the file as it does here is read in one go.
    for (size_t first = 0, end = 0; first < channels.size(); first = end) {
        for (end = first + 1; end < channels.size() && channels[end] == channels[end - 1] + 1;)
            ++end;
        const int begin = channels[first];
        if (!file->read_image(0, 0, begin, begin + int(end - first), type, samples + first * type.size(), pixel))
            fail(file, "cannot be read");
    }
}

Slice<Named> Input::channels()
{
    const OIIO::ImageSpec& spec = file->spec();
    named.clear();
    for (int i = 0; i < spec.nchannels; ++i) {
        const OIIO::TypeDesc format = spec.channelformat(i);
        if (format != OIIO::TypeDesc::HALF && format != OIIO::TypeDesc::FLOAT && format != OIIO::TypeDesc::UINT32)
            throw std::runtime_error("not an OpenEXR file");
        const Kind kind = format == OIIO::TypeDesc::HALF    ? Kind::Half
                          : format == OIIO::TypeDesc::FLOAT ? Kind::Float
                                                            : Kind::U32;
        named.push_back({ bytes(spec.channel_name(i)), kind });
    }
    return { named.data(), named.size() };
}

void Input::read_all(uint8_t* samples, size_t length) const
{
    const OIIO::ImageSpec& spec = file->spec();
    if (length != size_t(spec.image_pixels()) * spec.pixel_bytes(true))
        throw std::logic_error("the samples are not as many as the file's");
    if (!file->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UNKNOWN, samples))
        fail(file, "cannot be read");
}

}  // namespace twincast::oiio
