#include <cerrno>
#include <fstream>
#include <set>
#include <system_error>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/strutil.h>

#include "parts.h"

namespace twincast::oiio {

namespace {

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

std::string suffixes()
{
    // Formats that make no file, or none from colours: a window, a network stream, nothing, terminal text, depth.
    const std::set<std::string> no_files { "iv", "socket", "null", "term", "zfile" };
    std::vector<std::string> result;
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
    return OIIO::Strutil::join(result, ",");
}

void write(const std::string& name, const Layout& layout, const Attributes& attributes, Bytes samples)
{
    check_length(layout, samples.length);
    const OIIO::TypeDesc type = type_of(layout.kind);
    OIIO::ImageSpec spec(int(layout.width), int(layout.height), int(layout.channels), type);
    spec.alpha_channel = layout.alpha ? int(layout.channels) - 1 : -1;
    if (layout.straight)
        spec.attribute("oiio:UnassociatedAlpha", 1);
    for (auto& channel : layout.beside) {
        spec.channelnames.push_back(text(channel.name));
        spec.channelformats.push_back(type_of(channel.kind));
        ++spec.nchannels;
    }
    if (layout.beside.length != 0)
        spec.channelformats.insert(spec.channelformats.begin(), layout.channels, type);
    const bool integers = layout.kind == Kind::U8 || layout.kind == Kind::U16;
    spec.attribute("oiio:ColorSpace", layout.linear ? "Linear" : "sRGB");
    if (layout.tile) {
        spec.tile_width = spec.tile_height = int(layout.tile);
        spec.tile_depth                    = 1;
    }
    if (!integers)
        spec.attribute("compression", "zip");
    else
        spec.attribute("CompressionQuality", 95);  // JPEG, WebP; others take no notice
    spec.attribute("jpeg:subsampling", "4:4:4");

    spec.attribute("Software", text(attributes.software));
    if (attributes.world_to_camera.length == 16)
        spec.attribute("worldtocamera", OIIO::TypeMatrix, attributes.world_to_camera.data);
    if (attributes.world_to_screen.length == 16)
        spec.attribute("worldtoscreen", OIIO::TypeMatrix, attributes.world_to_screen.data);
    for (float value : attributes.fovcot)
        spec.attribute("fovcot", value);
    for (int value : attributes.samples_per_pixel)
        spec.attribute("samplesPerPixel", value);
    for (float value : attributes.render_time_seconds)
        spec.attribute("renderTimeSeconds", value);
    for (auto& attribute : attributes.texts)
        spec.attribute(text(attribute.name), text(attribute.value));

    auto file = writer(name);
    if (attributes.window.length == 4 && file->supports("displaywindow")) {
        spec.x           = attributes.window.data[0];
        spec.y           = attributes.window.data[1];
        spec.full_x      = 0;
        spec.full_y      = 0;
        spec.full_width  = attributes.window.data[2];
        spec.full_height = attributes.window.data[3];
    }
    // These writers get memory, and the file is written here. On a full disk OpenImageIO's EXR writer hangs and its JPEG
    // writer ends the process. Not all writers: that of TIFF takes memory, too, but leaves its directory out.
    OIIO::Filesystem::IOVecOutput memory;
    const std::set<std::string> to_memory { "openexr", "jpeg", "png" };
    const bool in_memory = to_memory.count(file->format_name()) && file->set_ioproxy(&memory);
    if (!file->open(name, spec))
        fail(file, "cannot be opened for writing");
    // Where channels are of several types: each as it is.
    const OIIO::TypeDesc given = layout.beside.length == 0 ? type : OIIO::TypeDesc(OIIO::TypeDesc::UNKNOWN);
    if (!file->write_image(given, samples.data))
        fail(file, "cannot be written");
    // Compressed formats write their last bytes here: a full disk may show only now.
    if (!file->close())
        fail(file, "cannot be finished");
    if (in_memory)
        save(name, memory.buffer());
}

}  // namespace twincast::oiio
