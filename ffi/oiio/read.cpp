#include "parts.h"

namespace twincast::oiio {

namespace {

std::unique_ptr<OIIO::ImageInput> reader(const std::string& path)
{
    // Straight alpha as it is: OpenImageIO would multiply encoded colours by it.
    OIIO::ImageSpec wishes;
    wishes.attribute("oiio:UnassociatedAlpha", 1);
    auto file = OIIO::ImageInput::open(path, &wishes);
    if (!file)
        fail(OIIO::geterror(), "not an image that OpenImageIO reads");
    return file;
}

// The values of an attribute, where it has this type; they are the file's.
template<typename T> Slice<T> values(const OIIO::ImageSpec& spec, const char* name, OIIO::TypeDesc type, size_t count)
{
    auto* attribute = spec.find_attribute(name, type);
    return attribute ? Slice<T> { static_cast<const T*>(attribute->data()), count } : Slice<T> { nullptr, 0 };
}

}  // namespace

Input::Input(const std::string& path)
    : file(reader(path))
{
}

Layout Input::layout() const
{
    const OIIO::ImageSpec& spec = file->spec();
    if (spec.deep || spec.depth > 1)
        throw std::runtime_error("a deep or volume image; only flat ones are read");
    if (spec.width < 0 || spec.height < 0 || spec.nchannels < 1)
        throw std::runtime_error("an image without pixels");

    Layout layout {};
    layout.width  = uint32_t(spec.width);
    layout.height = uint32_t(spec.height);
    // Colours come first, whatever else there is (depth, normals) comes after them.
    const bool gray  = spec.nchannels < 3;
    const int colour = gray ? 1 : 3;
    layout.alpha     = spec.nchannels > colour && spec.alpha_channel == colour;
    layout.channels  = uint32_t(colour + layout.alpha);
    layout.straight  = spec.get_int_attribute("oiio:UnassociatedAlpha") != 0;
    // Of the colours: channels may be of several types.
    const OIIO::TypeDesc format = spec.channelformat(0);
    layout.kind                 = format == OIIO::TypeDesc::UINT8  ? Kind::U8
                                  : format.is_floating_point()     ? Kind::Float
                                                                   : Kind::U16;
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
    if (!file->read_image(0, 0, 0, int(expected.channels), type_of(expected.kind), samples))
        fail(file, "cannot be read");
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
