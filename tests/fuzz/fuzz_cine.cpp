// SPDX-License-Identifier: MIT
// Any bytes as a .cine file: frames that can be read, or an error. A valid header is laid down first, and the input changes bytes of it:
// each four bytes are a place (16 bits) and a value.
// smoke: 3000
// links: ols_recordings
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "recordings/cine_file.hpp"

namespace {

constexpr uint32_t width = 16, height = 8, images = 3, setup_bytes = 6900;
constexpr uint32_t setup_at = 84, blocks_at = setup_at + setup_bytes, times_bytes = 8 + 8 * images,
                   offsets_at = blocks_at + times_bytes;
constexpr uint32_t image_bytes = width * height * 2, first_image = offsets_at + 8 * images,
                   file_bytes = first_image + images * (8 + image_bytes);

template <typename T>
void put(std::vector<uint8_t>& file, size_t at, T value) {
    std::memcpy(file.data() + at, &value, sizeof value);
}

std::vector<uint8_t> valid_file() {
    std::vector<uint8_t> file(file_bytes);
    put<uint16_t>(file, 0, 0x4943), put<uint16_t>(file, 2, 44), put<uint16_t>(file, 4, 2), put<uint16_t>(file, 6, 1);
    put<uint32_t>(file, 20, images), put<uint32_t>(file, 24, 44), put<uint32_t>(file, 28, setup_at),
        put<uint32_t>(file, 32, offsets_at);
    put<uint32_t>(file, 44, 40), put<uint32_t>(file, 48, width), put<uint32_t>(file, 52, height),
        put<uint16_t>(file, 56, 1);
    put<uint16_t>(file, 58, 16);
    put<uint16_t>(file, setup_at + 140, 0x5453), put<uint16_t>(file, setup_at + 142, setup_bytes);
    put<uint32_t>(file, setup_at + 808, 4), put<uint32_t>(file, setup_at + 896, 12);
    put<uint32_t>(file, blocks_at, times_bytes), put<uint16_t>(file, blocks_at + 4, 1002);
    for (uint32_t i = 0; i < images; ++i) {
        const uint32_t at = first_image + i * (8 + image_bytes);
        put<uint64_t>(file, offsets_at + 8 * i, at);
        put<uint32_t>(file, at, 8), put<uint32_t>(file, at + 4, image_bytes);
    }
    return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static const std::string path = "/dev/shm/fuzz_cine." + std::to_string(getpid());
    std::vector<uint8_t> file = valid_file();
    for (size_t i = 0; i + 3 <= size; i += 3) file[(data[i] | data[i + 1] << 8) % file.size()] = data[i + 2];
    if (size % 3 == 1) file.resize(file.size() * data[size - 1] / 255);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()), std::streamsize(file.size()));
    const auto cine = ols::open_cine(path);
    if (!cine.ok()) return 0;
    const ols::RecordingFacts& facts = (*cine)->facts();
    if (facts.frames() == 0 || facts.frames() * facts.width * facts.height > 8 * file.size()) std::abort();
    if (facts.has_times && facts.times_ns.size() != facts.frames()) std::abort();
    for (uint64_t i = 0; i < facts.frames(); ++i) {
        const auto frame = (*cine)->read(i);
        if (frame.ok() && frame->samples.size() != size_t(frame->pitch_bytes) * frame->height) std::abort();
    }
    return 0;
}
