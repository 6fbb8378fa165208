// What Twincast wants of OpenImageIO, 2.4 or later, as C sees it; src/image/oiio/bridge.rs has the same types in Rust.
//
// No exception leaves a function. Memory stays with the side that made it: what a function is given it reads during the
// call, and what it gives back belongs to the shim, as long as is said where.
#pragma once

#include <cstddef>
#include <cstdint>

namespace twincast::oiio {

// So many values that follow each other. Without any, `data` may be null.
template<typename T> struct Slice {
    const T* data;
    size_t length;

    const T* begin() const { return data; }
    const T* end() const { return data + length; }
};

// Text or anything else, of no particular encoding.
using Bytes = Slice<uint8_t>;

// Why a function failed, in words, which last until the thread's next call; null where it did not.
using Failure = Bytes;

// The type of a sample.
enum class Kind : uint32_t { U8, U16, U32, Half, Float };

// One of the channels of a file.
struct Named {
    Bytes name;
    Kind kind;
};

// An attribute.
struct Text {
    Bytes name;
    Bytes value;
};

// What a file holds.
struct Layout {
    uint32_t width;
    uint32_t height;
    // 1 to 4: gray or RGB, then alpha.
    uint32_t channels;
    Kind kind;
    // Edge of a tile; 0 for rows.
    uint32_t tile;
    // Whether the last channel is alpha, and if so, whether colours are not multiplied by it.
    bool alpha;
    bool straight;
    // Whether codes are written without a transfer function; of what is read nothing is said.
    bool linear;
    // What follows the colours in each pixel, of four bytes each.
    Slice<Named> beside;
    // Of what is read: how it has to be turned to be seen, 1 to 8 as EXIF counts; 1 for not at all.
    uint32_t orientation;
    // Of what is read: its x and y, and x, y, width and height of the picture that it is a part of.
    int32_t window[6];
};

// Attributes, as far as they are there: of 0 or 1 value, matrices of 0 or 16.
struct Attributes {
    Bytes software;
    Slice<float> world_to_camera;
    Slice<float> world_to_screen;
    Slice<float> fovcot;
    Slice<int32_t> samples_per_pixel;
    Slice<float> render_time_seconds;
    // x, y, and the width and height of the whole picture; or nothing.
    Slice<int32_t> window;
    Slice<Text> texts;
};

// A file opened for reading.
class Input;

struct Functions {
    // Suffixes of the formats that can be written, with commas between; they last until the thread's next call.
    Failure (*suffixes)(Bytes*);
    // Path, layout, attributes, samples.
    Failure (*write)(Bytes, const Layout*, const Attributes*, Bytes);
    // Path, and the format's name or a suffix of it: no other format's reader gets to see the file.
    Failure (*open)(Bytes, Bytes, Input**);
    void (*close)(Input*);
    // Width and height.
    Failure (*size)(const Input*, uint32_t*);
    // Of the colours; fails where there are none.
    Failure (*layout)(const Input*, Layout*);
    // They last until the next call for the same file.
    Failure (*attributes)(Input*, Attributes*);
    // Reads all samples of the colours into so many bytes.
    Failure (*read)(Input*, uint8_t*, size_t);
    // Every channel, in the order of the file; they last until the next call for the same file.
    Failure (*channels)(Input*, Slice<Named>*);
    // Reads all samples of all channels, side by side as they are in the file, into so many bytes.
    Failure (*read_all)(Input*, uint8_t*, size_t);
};

}  // namespace twincast::oiio

// The one name that the shim exports.
extern "C" __attribute__((visibility("default"))) const twincast::oiio::Functions* twincast_oiio();
