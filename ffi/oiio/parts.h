// What the files of the shim share: errors, texts and types on their way between Twincast and OpenImageIO.
#pragma once

#include <deque>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>

#include "shim.h"

namespace twincast::oiio {

inline std::string text(Bytes bytes)
{
    return std::string(reinterpret_cast<const char*>(bytes.data), bytes.length);
}

inline Bytes bytes(OIIO::string_view text)
{
    return { reinterpret_cast<const uint8_t*>(text.data()), text.size() };
}

// Throws the library's own words, or `otherwise` where it has none.
[[noreturn]] inline void fail(std::string words, const char* otherwise)
{
    throw std::runtime_error(words.empty() ? otherwise : words);
}

template<typename File> [[noreturn]] void fail(const File& file, const char* otherwise)
{
    fail(file->geterror(), otherwise);
}

inline OIIO::TypeDesc type_of(Kind kind)
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
inline void check_length(const Layout& layout, size_t bytes)
{
    size_t pixel = layout.channels * type_of(layout.kind).size();
    for (auto& channel : layout.beside)
        pixel += type_of(channel.kind).size();
    size_t expected = size_t(layout.width) * layout.height * pixel;
    if (bytes != expected)
        throw std::logic_error("the samples are not as many as the layout says");
}

// With commas between.
std::string suffixes();

void write(const std::string& name, const Layout& layout, const Attributes& attributes, Bytes samples);

class Input {
public:
    Input(const std::string& path, const std::string& format);
    void size(uint32_t* width_and_height) const;
    Layout layout() const;
    Attributes attributes();
    void read(uint8_t* samples, size_t length) const;
    Slice<Named> channels();
    void read_all(uint8_t* samples, size_t length) const;

private:
    // Where in the file the colours and alpha are, in this order.
    std::vector<int> picked() const;

    std::unique_ptr<OIIO::ImageInput> file;
    // What was given back and is not the file's; a deque's elements stay where they are as it grows.
    std::deque<std::string> strings;
    std::vector<Text> texts;
    std::vector<int32_t> window;
    std::vector<Named> named;
};

}  // namespace twincast::oiio
