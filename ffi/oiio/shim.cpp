#include <exception>

#include "parts.h"

namespace twincast::oiio {

namespace {

// Has `work` done, and gives back in words what it throws.
template<typename Work> Failure guarded(Work work) noexcept
{
    thread_local std::string words;
    try {
        try {
            work();
            return { nullptr, 0 };
        } catch (const std::exception& error) {
            words = error.what();
        }
        if (words.empty())
            words = "failed without a word";
        return bytes(words);
    } catch (...) {
        return bytes("out of memory, or an unknown exception");
    }
}

}  // namespace

}  // namespace twincast::oiio

extern "C" const twincast::oiio::Functions* twincast_oiio()
{
    using namespace twincast::oiio;
    // OpenImageIO lists its formats as it is first asked for one, and tells another thread of those alone that it has by then.
    guarded([] { OIIO::get_string_attribute("extension_list"); });
    static const Functions functions {
        [](Bytes* names) {
            return guarded([=] {
                thread_local std::string all;
                all    = suffixes();
                *names = bytes(all);
            });
        },
        [](Bytes path, const Layout* layout, const Attributes* attributes, Bytes samples) {
            return guarded([=] { write(text(path), *layout, *attributes, samples); });
        },
        [](Bytes path, Bytes format, Input** input) {
            return guarded([=] { *input = new Input(text(path), text(format)); });
        },
        [](Input* input) { guarded([=] { delete input; }); },
        [](const Input* input, uint32_t* size) { return guarded([=] { input->size(size); }); },
        [](const Input* input, Layout* layout) { return guarded([=] { *layout = input->layout(); }); },
        [](Input* input, Attributes* attributes) { return guarded([=] { *attributes = input->attributes(); }); },
        [](Input* input, uint8_t* samples, size_t length) { return guarded([=] { input->read(samples, length); }); },
        [](Input* input, Slice<Named>* channels) { return guarded([=] { *channels = input->channels(); }); },
        [](Input* input, uint8_t* samples, size_t length) { return guarded([=] { input->read_all(samples, length); }); },
    };
    return &functions;
}
