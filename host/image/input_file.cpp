// SPDX-License-Identifier: MIT
// The kind is looked at before the file is opened: opening a pipe waits for whoever writes to it.
#include "image/input_file.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

namespace ols {

namespace {

namespace fs = std::filesystem;

const char* kind_of(const fs::file_status& status) {
    switch (status.type()) {
        case fs::file_type::directory: return "a folder";
        case fs::file_type::block:
        case fs::file_type::character: return "a device";
        case fs::file_type::fifo: return "a pipe";
        default: return "no file";
    }
}

}  // namespace

Result<std::ifstream> open_input(const std::string& path) {
    std::error_code error;
    const auto status = fs::status(path, error);
    if (!fs::exists(status)) return fail("'" + path + "' is not there: check the path");
    if (!fs::is_regular_file(status)) return fail("'" + path + "' is " + kind_of(status) + ": name a file");
    std::ifstream stream(path, std::ios::binary);
    if (!stream) return fail("cannot open '" + path + "': check that you may read it");
    return stream;
}

std::string kind_of_bytes(std::string_view bytes) {
    using namespace std::string_view_literals;
    constexpr std::pair<std::string_view, const char*> kinds[] = {
        {"\x76\x2f\x31\x01"sv, "an OpenEXR file"},
        {"#?"sv, "a Radiance file"},
        {"\x89PNG"sv, "a PNG picture"},
        {"\xff\xd8\xff"sv, "a JPEG picture"},
        {"II*\0"sv, "a TIFF or raw picture"},
        {"MM\0*"sv, "a TIFF or raw picture"},
        {"PF"sv, "a PFM picture"},
        {"GIF8"sv, "a GIF picture"},
        {"BM"sv, "a BMP picture"},
        {"PK\x03\x04"sv, "a ZIP archive"},
        {"<"sv, "a page of text"},
    };
    if (bytes.empty()) return "empty";
    for (const auto& [start, kind] : kinds)
        if (bytes.starts_with(start)) return kind;
    return "no file of a kind known here";
}

Result<std::string> read_input(const std::string& path, uint64_t most) {
    auto stream = open_input(path);
    if (!stream) return stream.error();
    std::error_code error;
    const uint64_t size = fs::file_size(path, error);
    if (error || size > most)
        return fail(fmt::format("'{}' has {} bytes, and no more than {} are read: check what it is", path, size, most));
    std::string bytes(size, '\0');
    stream->read(bytes.data(), std::streamsize(size));
    if (uint64_t(stream->gcount()) != size) return fail("cannot read '" + path + "': check the disk");
    return bytes;
}

}  // namespace ols
