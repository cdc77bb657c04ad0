// SPDX-License-Identifier: MIT
// UF2 (Microsoft's file format specification; RP2040 datasheet 2.8.4.2) and the image's label.
#include "device/firmware_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "image_label.h"

namespace ols {

namespace {

struct Uf2Block {
    uint32_t magic_start0, magic_start1, flags, address, payload_bytes, number, count, family;
    uint8_t data[476];
    uint32_t magic_end;
};
static_assert(sizeof(Uf2Block) == 512);

constexpr uint32_t not_main_flash = 0x00000001, family_present = 0x00002000;
constexpr uint32_t rp2040_family = 0xe48bff56;
constexpr size_t label_offset = OLS_IMAGE_LABEL_ADDRESS - flash_address;

// What is wrong with block number `n` of `count`; empty when nothing is.
std::string block_defect(const Uf2Block& block, uint32_t n, uint32_t count) {
    if (block.magic_start0 != 0x0a324655 || block.magic_start1 != 0x9e5d5157 || block.magic_end != 0x0ab16f30)
        return "is no UF2 block";
    if (!(block.flags & family_present) || block.family != rp2040_family)
        return fmt::format("is for chip family {:08x}, not for the RP2040 (e48bff56)",
                           block.flags & family_present ? block.family : 0);
    if (block.flags & not_main_flash) return "is not for the main flash";
    if (block.count != count) return fmt::format("says that there are {} blocks, the file has {}", block.count, count);
    if (block.number != n) return fmt::format("is numbered {}", block.number);
    if (block.payload_bytes != flash_page_bytes)
        return fmt::format("has {} bytes, and a page of flash has 256", block.payload_bytes);
    if (block.address < flash_address || block.address - flash_address >= image_bytes_max)
        return fmt::format("goes to {:08x}, outside the image's part of flash ({:08x} to {:08x})", block.address,
                           flash_address, flash_address + image_bytes_max);
    if (block.address != flash_address + n * flash_page_bytes)
        return fmt::format("goes to {:08x}, and {:08x} is next", block.address, flash_address + n * flash_page_bytes);
    return {};
}

std::string text_of(const char* text, size_t bytes) {
    return std::string(text, strnlen(text, bytes));
}

bool is_printable(const std::string& text) {
    return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

}  // namespace

std::optional<ImageLabel> parse_label(std::span<const uint8_t> bytes) {
    ols_image_label label;
    if (bytes.size() < sizeof label) return {};
    std::memcpy(&label, bytes.data(), sizeof label);
    if (label.magic != OLS_IMAGE_LABEL_MAGIC || label.label_bytes < sizeof label) return {};
    ImageLabel found{text_of(label.board, sizeof label.board),
                     text_of(label.firmware_version, sizeof label.firmware_version), label.layout_hash};
    if (found.board.empty() || !is_printable(found.board) || !is_printable(found.version)) return {};
    return found;
}

bool boot2_is_valid(std::span<const uint8_t> first_page) {
    constexpr size_t code_bytes = 252;
    if (first_page.size() < code_bytes + 4) return false;
    uint32_t crc = 0xffffffff;  // polynomial 0x04c11db7, neither reflected nor inverted
    for (const uint8_t byte : first_page.first(code_bytes)) {
        crc ^= uint32_t(byte) << 24;
        for (int bit = 0; bit < 8; bit++) crc = crc << 1 ^ (crc & 0x80000000 ? 0x04c11db7 : 0);
    }
    uint32_t stated;
    std::memcpy(&stated, first_page.data() + code_bytes, sizeof stated);
    return crc == stated;
}

Result<FirmwareImage> parse_uf2(std::span<const uint8_t> file, const std::string& name) {
    const auto refuse = [&](const std::string& what) {
        return fail(name + ": " + what + "; build the image again: make firmware");
    };
    if (file.empty() || file.size() % sizeof(Uf2Block) != 0)
        return refuse(fmt::format("{} bytes are no whole number of UF2 blocks", file.size()));
    if (file.size() / sizeof(Uf2Block) > image_bytes_max / flash_page_bytes)
        return refuse("it is longer than the board's flash");
    const uint32_t count = uint32_t(file.size() / sizeof(Uf2Block));
    FirmwareImage image;
    for (uint32_t n = 0; n < count; n++) {
        Uf2Block block;
        std::memcpy(&block, file.data() + n * sizeof block, sizeof block);
        if (const std::string defect = block_defect(block, n, count); !defect.empty())
            return refuse(fmt::format("block {} {}", n, defect));
        image.bytes.insert(image.bytes.end(), block.data, block.data + flash_page_bytes);
    }
    if (!boot2_is_valid(image.bytes)) return refuse("boot2 does not have the CRC that the boot ROM checks");
    const auto label = image.bytes.size() < label_offset + sizeof(ols_image_label)
                           ? std::nullopt
                           : parse_label(std::span(image.bytes).subspan(label_offset));
    if (!label) return refuse("it does not say which board it is for, so it is no firmware of an open light stage");
    image.label = *label;
    image.uf2.assign(file.begin(), file.end());
    return image;
}

Result<FirmwareImage> read_uf2(const std::string& path) {
    std::error_code missing;
    if (!std::filesystem::is_regular_file(path, missing))
        return fail("cannot read '" + path + "': it is no file: check the path, or build it: make firmware");
    std::ifstream file(path, std::ios::binary);
    if (!file) return fail("cannot read '" + path + "': check the path, or build it: make firmware");
    // One block more than any image has, so that a longer file is seen to be too long.
    std::vector<char> bytes((image_bytes_max / flash_page_bytes + 1) * sizeof(Uf2Block));
    file.read(bytes.data(), std::streamsize(bytes.size()));
    bytes.resize(size_t(file.gcount()));
    return parse_uf2({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, path);
}

}  // namespace ols
