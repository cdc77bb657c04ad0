// SPDX-License-Identifier: MIT
// The layout of headers: "OpenEXR File Layout", openexr.com, sections "Magic Number" to "Header".
#include "archive/exr_input.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

#include "exceptions.hpp"

namespace ols {

namespace {

constexpr size_t held_bytes = 1 << 16;
constexpr int parts_max = 7;
constexpr size_t name_bytes_max = 255;
constexpr uint32_t magic_number = 20000630, version_number = 2, multi_part_flag = 0x1000, long_names_flag = 0x400;
constexpr std::string_view attribute_types[] = {"box2i",    "channels",  "chlist",        "compression", "float",
                                                "int",      "lineOrder", "rational",      "string",      "tiledesc",
                                                "timecode", "v2f",       "chromaticities"};

// Little-endian, as everything in these files.
uint32_t read_word(ExrInput& input) {
    unsigned char b[4];
    input.read(reinterpret_cast<char*>(b), 4);
    return b[0] | uint32_t(b[1]) << 8 | uint32_t(b[2]) << 16 | uint32_t(b[3]) << 24;
}

// Up to its zero.
std::string read_name(ExrInput& input) {
    std::string name;
    for (char c; input.read(&c, 1), c != 0;) {
        name += c;
        if (name.size() > name_bytes_max) throw std::runtime_error("a name in its header has no end");
    }
    return name;
}

// False behind the last attribute of a part.
bool skip_attribute(ExrInput& input, uint64_t file_bytes) {
    const std::string name = read_name(input);
    if (name.empty()) return false;
    const std::string type = read_name(input);
    if (std::ranges::find(attribute_types, type) == std::end(attribute_types))
        throw std::runtime_error("its header has an attribute of a type that no target has");
    const uint64_t size = read_word(input);
    if (size > file_bytes - std::min(file_bytes, input.tellg()))
        throw std::runtime_error("an attribute of its header is larger than the file");
    input.seekg(input.tellg() + size);
    return true;
}

void skip_headers(ExrInput& input, uint64_t file_bytes) {
    if (read_word(input) != magic_number) throw std::runtime_error("it is no OpenEXR file");
    if ((read_word(input) & ~long_names_flag) != (version_number | multi_part_flag))
        throw std::runtime_error("it is no OpenEXR file of several parts");
    for (int parts = 0; skip_attribute(input, file_bytes); ++parts) {
        if (parts == parts_max) throw std::runtime_error("it has more parts than a target has");
        while (skip_attribute(input, file_bytes)) {
        }
    }
}

}  // namespace

ExrInput::ExrInput(const ArchiveFile& file) : Imf::IStream(file.path().c_str()), file_(file) {}

bool ExrInput::read(char bytes[], int count) {
    const auto wanted = uint64_t(count);
    // A file may say that its tiles lie anywhere.
    if (wanted > file_.size() || position_ > file_.size() - wanted) throw std::runtime_error("it ends early");
    const auto fill = [&](uint64_t at, char* out, size_t most) {
        const auto read_bytes = file_.read(at, out, most);
        if (!read_bytes) throw std::runtime_error(read_bytes.error().message);
        return *read_bytes;
    };
    const bool is_held = position_ >= held_at_ && position_ + wanted <= held_at_ + held_.size();
    if (!is_held && wanted < held_bytes) {
        held_.resize(held_bytes);
        held_at_ = position_;
        held_.resize(fill(position_, held_.data(), held_bytes));
    }
    if (wanted >= held_bytes) {
        if (fill(position_, bytes, wanted) < wanted) throw std::runtime_error("it ends early");
    } else {
        if (position_ + wanted > held_at_ + held_.size()) throw std::runtime_error("it ends early");
        std::memcpy(bytes, held_.data() + (position_ - held_at_), wanted);
    }
    position_ += wanted;
    return position_ < file_.size();
}

Status check_exr_headers(const ArchiveFile& file) {
    try {
        ExrInput input(file);
        skip_headers(input, file.size());
        return Done{};
    } catch (const std::exception& e) {
        return fail("cannot read '" + file.path() + "': " + words_of(e));
    }
}

}  // namespace ols
