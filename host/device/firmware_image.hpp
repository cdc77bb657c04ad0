// SPDX-License-Identifier: MIT
// FirmwareImage: what is to be in a board's flash, read from a UF2 file and checked before anything is sent.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

constexpr uint32_t flash_address = 0x10000000;  // RP2040 datasheet 2.2.1
constexpr uint32_t flash_bytes = 2 << 20;       // of the smallest board's chip
constexpr uint32_t flash_page_bytes = 256;      // written at once (W25Q16JV datasheet 8.2.13)
constexpr uint32_t flash_sector_bytes = 4096;   // erased at once (8.2.15)
// The last sector is the flasher's own note (board_flash.hpp), so an image ends before it.
constexpr uint32_t image_bytes_max = flash_bytes - flash_sector_bytes;

// What an image says of itself (protocol/image_label.h).
struct ImageLabel {
    std::string board, version;
    uint64_t layout_hash = 0;
};

// Reads a label from the bytes at its place; nothing when there is none.
std::optional<ImageLabel> parse_label(std::span<const uint8_t> bytes);

struct FirmwareImage {
    std::vector<uint8_t> bytes;  // from flash_address on, whole pages
    std::vector<uint8_t> uf2;    // the file, for the BOOTSEL drive
    ImageLabel label;
};

// True when the boot ROM would start what these first 256 bytes of flash hold (datasheet 2.8.1.3.1).
bool boot2_is_valid(std::span<const uint8_t> first_page);

// From the bytes of a UF2 file; `name` is for messages. Refused, with what to do, unless: every block is whole, numbered
// in order, for the RP2040's flash and of one page; pages follow each other from the start of flash without gap or
// overlap; boot2 has its CRC; the image says which board it is for.
Result<FirmwareImage> parse_uf2(std::span<const uint8_t> file, const std::string& name);

Result<FirmwareImage> read_uf2(const std::string& path);

}  // namespace ols
