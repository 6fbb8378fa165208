#include "twincast/ffi/oiio.h"

#include <cerrno>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/strutil.h>

#include "twincast/src/image/oiio.rs.h"

namespace twincast::oiio {

namespace {

std::string text(Bytes bytes)
{
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

// Throws the library's own words, or `otherwise` where it has none.
[[noreturn]] void fail(std::string words, const char* otherwise)
{
    throw std::runtime_error(words.empty() ? otherwise : words);
}

template<typename File> [[noreturn]] void fail(const File& file, const char* otherwise)
{
    fail(file->geterror(), otherwise);
}

OIIO::TypeDesc type_of(Kind kind)
{
    switch (kind) {
    case Kind::U8: return OIIO::TypeDesc::UINT8;
    case Kind::U16: return OIIO::TypeDesc::UINT16;
    case Kind::U32: return OIIO::TypeDesc::UINT32;
    case Kind::Half: return OIIO::TypeDesc::HALF;
    case Kind::Float: return OIIO::TypeDesc::FLOAT;
    }
    throw std::logic_error("not a type of sample");
}

// OpenImageIO gets an address and no length: this is where the length is made sure of.
void check_length(const Layout& layout, size_t bytes)
{
    size_t pixel = layout.channels * type_of(layout.kind).size();
    for (auto& channel : layout.beside)
        pixel += type_of(channel.kind).size();
    size_t expected = size_t(layout.width) * layout.height * pixel;
    if (bytes != expected)
        throw std::logic_error("the samples are not as many as the layout says");
}

std::unique_ptr<OIIO::ImageOutput> writer(const std::string& path)
{
    auto file = OIIO::ImageOutput::create(path);
    if (!file)
        fail(OIIO::geterror(), "no writer for this suffix");
    return file;
}

void save(const std::string& path, const std::vector<unsigned char>& bytes)
{
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    file.close();
    if (!file)
        throw std::system_error(errno, std::generic_category(), "cannot be written");
}

}  // namespace

rust::Vec<rust::String> suffixes()
{
    // Formats that make no file, or none from colours: a window, a network stream, nothing, terminal text, depth.
    const std::set<std::string> no_files { "iv", "socket", "null", "term", "zfile" };
    rust::Vec<rust::String> result;
    // "png:png;tiff:tif,tiff,tx": all formats, also those that are only read.
    for (auto& format : OIIO::Strutil::splits(OIIO::get_string_attribute("extension_list"), ";")) {
        auto colon = format.find(':');
        if (colon == std::string::npos || no_files.count(format.substr(0, colon)))
            continue;
        for (auto& suffix : OIIO::Strutil::splits(format.substr(colon + 1), ",")) {
            if (OIIO::ImageOutput::create("a." + suffix))
                result.push_back(OIIO::Strutil::lower(suffix));
            else
                OIIO::geterror();  // forgets it
        }
    }
    return result;
}

void write(Bytes path, const Layout& layout, const Attributes& attributes, Bytes samples)
{
    check_length(layout, samples.size());
    const OIIO::TypeDesc type = type_of(layout.kind);
    OIIO::ImageSpec spec(int(layout.width), int(layout.height), int(layout.channels), type);
    spec.alpha_channel = layout.alpha ? int(layout.channels) - 1 : -1;
    if (layout.straight)
        spec.attribute("oiio:UnassociatedAlpha", 1);
    for (auto& channel : layout.beside) {
        spec.channelnames.push_back(std::string(channel.name));
        spec.channelformats.push_back(type_of(channel.kind));
        ++spec.nchannels;
    }
    if (!layout.beside.empty())
        spec.channelformats.insert(spec.channelformats.begin(), layout.channels, type);
    const bool integers = layout.kind == Kind::U8 || layout.kind == Kind::U16;
    spec.attribute("oiio:ColorSpace", integers ? "sRGB" : "Linear");
    if (layout.tile) {
        spec.tile_width = spec.tile_height = int(layout.tile);
        spec.tile_depth                    = 1;
    }
    if (!integers)
        spec.attribute("compression", "zip");
    else
        spec.attribute("CompressionQuality", 95);  // JPEG, WebP; others take no notice
    spec.attribute("jpeg:subsampling", "4:4:4");

    spec.attribute("Software", std::string(attributes.software));
    if (attributes.world_to_camera.size() == 16)
        spec.attribute("worldtocamera", OIIO::TypeMatrix, attributes.world_to_camera.data());
    if (attributes.world_to_screen.size() == 16)
        spec.attribute("worldtoscreen", OIIO::TypeMatrix, attributes.world_to_screen.data());
    for (float value : attributes.fovcot)
        spec.attribute("fovcot", value);
    for (int value : attributes.samples_per_pixel)
        spec.attribute("samplesPerPixel", value);
    for (float value : attributes.render_time_seconds)
        spec.attribute("renderTimeSeconds", value);
    for (auto& text : attributes.texts)
        spec.attribute(std::string(text.name), std::string(text.value));

    const std::string name = text(path);
    auto file              = writer(name);
    if (attributes.window.size() == 4 && file->supports("displaywindow")) {
        spec.x           = attributes.window[0];
        spec.y           = attributes.window[1];
        spec.full_x      = 0;
        spec.full_y      = 0;
        spec.full_width  = attributes.window[2];
        spec.full_height = attributes.window[3];
    }
    // These writers get memory, and the file is written here. On a full disk OpenImageIO's EXR writer hangs and its JPEG
    // writer ends the process. Not all writers: that of TIFF takes memory, too, but leaves its directory out.
    OIIO::Filesystem::IOVecOutput memory;
    const std::set<std::string> to_memory { "openexr", "jpeg", "png" };
    const bool in_memory = to_memory.count(file->format_name()) && file->set_ioproxy(&memory);
    if (!file->open(name, spec))
        fail(file, "cannot be opened for writing");
    // Where channels are of several types: each as it is.
    const OIIO::TypeDesc given = layout.beside.empty() ? type : OIIO::TypeDesc(OIIO::TypeDesc::UNKNOWN);
    if (!file->write_image(given, samples.data()))
        fail(file, "cannot be written");
    // Compressed formats write their last bytes here: a full disk may show only now.
    if (!file->close())
        fail(file, "cannot be finished");
    if (in_memory)
        save(name, memory.buffer());
}

Input::Input(std::unique_ptr<OIIO::ImageInput> file)
    : file(std::move(file))
{
}

std::unique_ptr<Input> open(Bytes path)
{
    // Straight alpha as it is: OpenImageIO would multiply encoded colours by it.
    OIIO::ImageSpec wishes;
    wishes.attribute("oiio:UnassociatedAlpha", 1);
    auto file = OIIO::ImageInput::open(text(path), &wishes);
    if (!file)
        fail(OIIO::geterror(), "not an image that OpenImageIO reads");
    return std::make_unique<Input>(std::move(file));
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

Attributes Input::attributes() const
{
    const OIIO::ImageSpec& spec = file->spec();
    Attributes found {};
    auto matrix = [&](const char* name, rust::Vec<float>& into) {
        if (auto* attribute = spec.find_attribute(name, OIIO::TypeMatrix))
            for (int i = 0; i < 16; ++i)
                into.push_back(static_cast<const float*>(attribute->data())[i]);
    };
    auto number = [&](const char* name, rust::Vec<float>& into) {
        if (spec.find_attribute(name, OIIO::TypeFloat))
            into.push_back(spec.get_float_attribute(name));
    };
    // Lossy: a file may hold any bytes.
    const std::string software = spec.get_string_attribute("Software");
    found.software             = rust::String::lossy(software);
    matrix("worldtocamera", found.world_to_camera);
    matrix("worldtoscreen", found.world_to_screen);
    number("fovcot", found.fovcot);
    number("renderTimeSeconds", found.render_time_seconds);
    if (spec.find_attribute("samplesPerPixel", OIIO::TypeInt))
        found.samples_per_pixel.push_back(spec.get_int_attribute("samplesPerPixel"));
    const bool whole = spec.x == 0 && spec.y == 0 && spec.full_width == spec.width && spec.full_height == spec.height;
    if (!whole && spec.full_x == 0 && spec.full_y == 0)
        for (int number : { spec.x, spec.y, spec.full_width, spec.full_height })
            found.window.push_back(number);
    for (auto& attribute : spec.extra_attribs)
        if (attribute.type() == OIIO::TypeString) {
            const std::string value = attribute.get_string();
            found.texts.push_back({ rust::String::lossy(attribute.name().string()), rust::String::lossy(value) });
        }
    return found;
}

void Input::read(rust::Slice<uint8_t> samples) const
{
    const Layout expected = layout();
    check_length(expected, samples.size());
    if (!file->read_image(0, 0, 0, int(expected.channels), type_of(expected.kind), samples.data()))
        fail(file, "cannot be read");
}

rust::Vec<Named> Input::channels() const
{
    const OIIO::ImageSpec& spec = file->spec();
    rust::Vec<Named> result;
    for (int i = 0; i < spec.nchannels; ++i) {
        const OIIO::TypeDesc format = spec.channelformat(i);
        if (format != OIIO::TypeDesc::HALF && format != OIIO::TypeDesc::FLOAT && format != OIIO::TypeDesc::UINT32)
            throw std::runtime_error("not an OpenEXR file");
        const Kind kind = format == OIIO::TypeDesc::HALF    ? Kind::Half
                          : format == OIIO::TypeDesc::FLOAT ? Kind::Float
                                                            : Kind::U32;
        result.push_back({ rust::String::lossy(spec.channel_name(i)), kind });
    }
    return result;
}

void Input::read_all(rust::Slice<uint8_t> samples) const
{
    const OIIO::ImageSpec& spec = file->spec();
    if (samples.size() != size_t(spec.image_pixels()) * spec.pixel_bytes(true))
        throw std::logic_error("the samples are not as many as the file's");
    if (!file->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UNKNOWN, samples.data()))
        fail(file, "cannot be read");
}

}  // namespace twincast::oiio
