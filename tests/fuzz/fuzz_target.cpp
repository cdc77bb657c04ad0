// SPDX-License-Identifier: MIT
// Fuzzes the reader of targets, and OpenEXR behind it: the bytes of a good file with some of them replaced, in an archive whose
// journal states the size that they have. It is read to its last sample or refused.
// links: ols_archive
// smoke: 2000
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "archive/archive.hpp"

namespace {

void expect(bool truth) {
    if (!truth) abort();
}

struct GoodArchive {
    std::string path = std::filesystem::temp_directory_path() / ("fuzz_target_" + std::to_string(getpid()) + ".rfa");
    std::string file = path + "/cam0/target_000000.exr", bytes;

    GoodArchive() {
        ols::TakeInfo info;
        info.value_unit = "pixel";
        info.compression = ols::Compression::zips;
        info.lights = {{"a", {0, 0, 1}}, {"b", {0, 1, 0}}};
        ols::Target target;
        target.width = 5, target.height = 3;
        target.cfa = ols::Cfa::rggb;
        target.lamps.assign(2, ols::Plane(15, 0.5f));
        target.mask.assign(15, 0);
        target.variance.assign(15, 0.1f);
        target.matte = {2, {std::vector<float>(15, 0.5f)}, {}};
        target.motion = {{-0.01, 0.01}, {ols::FlowField(5, 3), ols::FlowField(5, 3)}};
        auto writer = ols::ArchiveWriter::create(path, info, true);
        expect(writer && writer->write_target(target).ok() && writer->finish().ok());
        std::ifstream stream(file, std::ios::binary);
        bytes = {std::istreambuf_iterator<char>(stream), {}};
    }
    ~GoodArchive() { std::filesystem::remove_all(path); }
};

}  // namespace

// Three bytes of input replace one of the file: where, and with what.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* input, size_t size) {
    static const GoodArchive good;
    static const auto archive = ols::ArchiveReader::open(good.path);
    expect(archive.ok());
    std::string bytes = good.bytes;
    for (size_t i = 0; i + 2 < size; i += 3)
        bytes[(input[i] | size_t(input[i + 1]) << 8) % bytes.size()] = char(input[i + 2]);
    std::ofstream(good.file, std::ios::binary) << bytes;
    const auto target = archive->open_target(0, 0, ols::TargetCheck::size);
    if (!target) {
        expect(target.error().message.find("target_000000.exr") != std::string::npos);
        return 0;
    }
    expect(target->head().width * target->head().height == 15);
    if (const auto read = target->read(); read) expect(read->lamps.size() == 2 && read->lamps[1].size() == 15);
    if (!target->head().motion.times_s.empty()) (void)target->read_motion();
    return 0;
}
