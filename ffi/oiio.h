// The C++ side of src/image/oiio.rs: what Twincast wants of OpenImageIO, 2.4 or later.
// Functions that can fail throw std::runtime_error, which cxx turns into a Rust error.
#pragma once

#include <cstdint>
#include <memory>

#include <OpenImageIO/imageio.h>

#include "rust/cxx.h"

namespace twincast::oiio {

struct Layout;
struct Attributes;
struct Named;
using Bytes = rust::Slice<const uint8_t>;

rust::Vec<rust::String> suffixes();
void write(Bytes path, const Layout& layout, const Attributes& attributes, Bytes samples);

class Input {
public:
    explicit Input(std::unique_ptr<OIIO::ImageInput> file);
    Layout layout() const;
    Attributes attributes() const;
    void read(rust::Slice<uint8_t> samples) const;
    rust::Vec<Named> channels() const;
    void read_all(rust::Slice<uint8_t> samples) const;

private:
    std::unique_ptr<OIIO::ImageInput> file;
};

std::unique_ptr<Input> open(Bytes path);

}  // namespace twincast::oiio
