// SPDX-License-Identifier: MIT
// Fuzzes the reader of archives: a journal of any bytes beside a good manifest, one of any lines whose chain is made right, a
// good manifest changed by any JSON merge patch, or one of any bytes. It opens or says why not, verifies, and never calls a target
// intact, for there is none.
// links: ols_archive
// smoke: 6000
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "archive/archive.hpp"
#include "archive/journal.hpp"

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

std::string read_text(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

void write_text(const std::string& path, const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
}

// Each line without its last brace, and with its chain.
std::string chained(const std::string& lines) {
    std::string text;
    std::istringstream stream(lines);
    for (std::string line; std::getline(stream, line);) {
        text += line.substr(0, line.size() - line.ends_with('}'));
        text += ols::chain_text(ols::crc32_of(0, text.data(), text.size())) + "\n";
    }
    return text;
}

struct GoodArchive {
    std::string path = std::filesystem::temp_directory_path() / ("fuzz_archive_" + std::to_string(getpid()) + ".rfa");
    std::string manifest, journal;

    GoodArchive() {
        ols::TakeInfo info;
        info.value_unit = "pixel";
        info.lights = {{"a", {0, 0, 1}}, {"b", {0, 1, 0}}};
        expect(ols::ArchiveWriter::create(path, info, true)->finish().ok());
        manifest = read_text(path + "/manifest.json");
        journal = read_text(path + "/journal.jsonl");
    }
    ~GoodArchive() { std::filesystem::remove_all(path); }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
    static const GoodArchive good;
    if (size == 0) return 0;
    const std::string input(reinterpret_cast<const char*>(bytes) + 1, size - 1);
    write_text(good.path + "/manifest.json", good.manifest);
    write_text(good.path + "/journal.jsonl", good.journal);
    const int kind = bytes[0] % 4;
    if (kind == 0) write_text(good.path + "/journal.jsonl", input);
    if (kind == 1) write_text(good.path + "/journal.jsonl", chained(input));
    if (kind == 2) write_text(good.path + "/manifest.json", input);
    if (kind == 3) {
        auto manifest = nlohmann::json::parse(good.manifest);
        const auto patch = nlohmann::json::parse(input, nullptr, false);
        if (patch.is_discarded()) return 0;
        manifest.merge_patch(patch);
        write_text(good.path + "/manifest.json",
                   manifest.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    }
    const auto archive = ols::ArchiveReader::open(good.path);
    if (!archive) {
        expect(kind >= 2 && !archive.error().message.empty());
        return 0;
    }
    expect(archive->verify().intact.empty());
    for (const auto& entry : archive->targets()) expect(!archive->read_target(entry.camera, entry.index).ok());
    return 0;
}
