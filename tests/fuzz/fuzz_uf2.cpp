// SPDX-License-Identifier: MIT
// Firmware images: an input is either a file, or, after a zero byte, patches of four bytes to a good one (a place in
// units of four bytes, then a value), so that most checks are passed and the last ones reached. What is accepted must be
// what the boot ROM would start, by an independent CRC.
// links: ols_device
#include <cstdlib>
#include <cstring>

#include "../unit/board_model.hpp"
#include "device/firmware_image.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t byte_count) {
    static const ols::test::Bytes good = ols::test::make_uf2(ols::test::make_image("pico", "1.2.3", 1, 5));
    ols::test::Bytes file(bytes, bytes + byte_count);
    if (byte_count > 0 && bytes[0] == 0) {
        file = good;
        for (size_t at = 1; at + 6 <= byte_count; at += 6) {
            const size_t place = 4 * ((size_t(bytes[at]) | size_t(bytes[at + 1]) << 8) % (file.size() / 4));
            std::memcpy(&file[place], bytes + at + 2, 4);
        }
    }
    const auto image = ols::parse_uf2(file, "fuzz");
    if (!image.ok()) return 0;
    uint32_t stated;
    std::memcpy(&stated, &image->bytes[252], 4);
    const bool sound = image->bytes.size() == file.size() / 2 && !image->label.board.empty() &&
                       image->label.board.size() <= 16 &&
                       ols::test::boot_rom_crc(std::span(image->bytes).first(252)) == stated;
    if (!sound) abort();
    return 0;
}
