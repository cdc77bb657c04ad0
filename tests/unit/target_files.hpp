// SPDX-License-Identifier: MIT
// Target files made by OpenEXR's own writer, with any headers, put into an archive whose journal agrees with them.
#pragma once

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfPartType.h>
#include <ImfTiledOutputPart.h>
#include <zlib.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace ols::test {

inline uint32_t zlib_crc32(const std::string& text) {
    return uint32_t(crc32(0, reinterpret_cast<const Bytef*>(text.data()), uInt(text.size())));
}

inline nlohmann::json zlib_checksum(const std::string& text) {
    char digits[16];
    snprintf(digits, sizeof digits, "%08x", zlib_crc32(text));
    return {{"bytes", text.size()}, {"crc32", digits}};
}

inline std::string read_text(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

inline void write_text(const std::string& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
}

inline std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
}

inline std::string joined(const std::vector<std::string>& lines) {
    std::string text;
    for (const auto& line : lines) text += line + "\n";
    return text;
}

// The lines of a journal with the chain made anew.
inline std::string chained(const std::vector<std::string>& lines) {
    std::string text;
    for (std::string line : lines) {
        const size_t at = line.rfind(",\"chain\"");
        line.resize(at != std::string::npos ? at : line.size() - line.ends_with('}'));
        text += line;
        char chain[32];
        snprintf(chain, sizeof chain, ",\"chain\":\"%08x\"}\n", zlib_crc32(text));
        text += chain;
    }
    return text;
}

// Makes the journal of an archive agree with the manifest and the one target that stand there now.
inline void make_journal_agree(const std::string& archive) {
    const std::string manifest = read_text(archive + "/manifest.json");
    const std::string target = read_text(archive + "/cam0/target_000000.exr");
    std::vector<std::string> lines;
    for (const auto& line : lines_of(read_text(archive + "/journal.jsonl"))) {
        auto json = nlohmann::json::parse(line);
        json.erase("chain");
        if (json["event"] == "end") json["manifest"] = zlib_checksum(manifest);
        if (json["event"] == "target") json.update(zlib_checksum(target));
        lines.push_back(json.dump());
    }
    write_text(archive + "/journal.jsonl", chained(lines));
}

// Imf::Header::erase() leaks in OpenEXR 3.1.
inline Imf::Header without(const Imf::Header& header, const std::string& attribute) {
    Imf::Header rest;
    for (auto it = header.begin(); it != header.end(); ++it)
        if (it.name() != attribute) rest.insert(it.name(), it.attribute());
    return rest;
}

inline std::vector<Imf::Header> headers_of(const std::string& path) {
    const Imf::MultiPartInputFile file(path.c_str());
    std::vector<Imf::Header> headers;
    for (int i = 0; i < file.parts(); ++i) headers.push_back(without(file.header(i), "chunkCount"));
    return headers;
}

// A file of these parts whose samples are all 0. Tiled parts of one or more levels.
inline void write_blank(const std::string& path, const std::vector<Imf::Header>& headers) {
    Imf::MultiPartOutputFile file(path.c_str(), headers.data(), int(headers.size()));
    for (int i = 0; i < int(headers.size()); ++i) {
        Imf::TiledOutputPart part(file, i);
        const Imath::Box2i window = headers[i].dataWindow();
        const size_t width = size_t(window.max.x - window.min.x + 1), height = size_t(window.max.y - window.min.y + 1);
        std::vector<char> zeros(width * height * 4);
        Imf::FrameBuffer buffer;
        for (auto it = headers[i].channels().begin(); it != headers[i].channels().end(); ++it)
            buffer.insert(it.name(),
                          Imf::Slice::Make(it.channel().type, zeros.data(), window.min, int64_t(width), int64_t(height),
                                           size_t(4), 4 * width, it.channel().xSampling, it.channel().ySampling));
        part.setFrameBuffer(buffer);
        for (int level = 0; level < part.numLevels(); ++level)
            part.writeTiles(0, part.numXTiles(level) - 1, 0, part.numYTiles(level) - 1, level);
    }
}

}  // namespace ols::test
