// SPDX-License-Identifier: MIT
// Archives: what is written comes back, exrheader (another program) sees the layout, damage is named. Crashes and full
// disks are in test_archive_crash.cpp.
// links: ols_archive
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "archive/archive.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

std::string output_of(const std::string& command) {
    std::string text;
    FILE* pipe = popen((command + " 2>&1").c_str(), "r");
    char buffer[4096];
    while (const size_t n = fread(buffer, 1, sizeof buffer, pipe)) text.append(buffer, n);
    pclose(pipe);
    return text;
}

bool any_contains(const std::vector<std::string>& lines, const std::string& what) {
    return std::any_of(lines.begin(), lines.end(), [&](const auto& l) { return l.find(what) != std::string::npos; });
}

void flip_byte(const std::filesystem::path& path, std::streamoff where) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(where);
    const char byte = char(file.get());
    file.seekp(where);
    file.put(char(byte ^ 0x10));
}

}  // namespace

class Archive : public TakeDirectory {};

TEST_F(Archive, targets_come_back_as_they_were_written) {
    for (const Cfa cfa : {Cfa::rggb, Cfa::none, Cfa::rgb})
        for (const auto type : {SampleType::half_float, SampleType::single_float})
            for (const auto compression : {Compression::none, Compression::zips}) {
                TakeInfo info = take_info(5);
                info.sample_type = type;
                info.compression = compression;
                auto writer = ArchiveWriter::create(path, info, true);
                ASSERT_TRUE(writer.ok()) << writer.error().message;
                const Target target = numbered_target(5, 130, 70, cfa, 3);
                ASSERT_TRUE(writer->write_target(target).ok());
                ASSERT_TRUE(writer->finish().ok());

                const auto reader = ArchiveReader::open(path);
                ASSERT_TRUE(reader.ok()) << reader.error().message;
                EXPECT_TRUE(reader->finished());
                const auto back = reader->read_target(0, 3);
                ASSERT_TRUE(back.ok()) << back.error().message;
                EXPECT_EQ(back->lamps, target.lamps);
                EXPECT_EQ(back->mask, target.mask);
                EXPECT_EQ(back->variance, target.variance);
                EXPECT_EQ(back->cfa, cfa);
                EXPECT_EQ(back->missing_lamps, target.missing_lamps);
                EXPECT_EQ(back->provenance, target.provenance);
                EXPECT_EQ(reader->verify().problems, std::vector<std::string>{});
            }
}

TEST_F(Archive, a_box_of_a_target_is_what_lies_there_in_the_whole) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    const Target target = numbered_target(2, 200, 150, Cfa::rgb, 0);
    ASSERT_TRUE(writer->write_target(target).ok());
    const auto reader = ArchiveReader::open(path);
    for (const Box box : {Box{64, 64, 64, 64}, Box{1, 2, 198, 147}, Box{130, 70, 70, 80}, Box{199, 149, 1, 1}}) {
        const auto part = reader->read_box(0, 0, box);
        ASSERT_TRUE(part.ok()) << part.error().message;
        ASSERT_EQ(part->lamps.size(), 6u);
        for (size_t c = 0; c < 6; ++c)
            for (int y = 0; y < box.height; ++y)
                for (int x = 0; x < box.width; ++x)
                    ASSERT_EQ(part->lamps[c][y * box.width + x], target.lamps[c][(y + box.y) * 200 + x + box.x]);
    }
}

// 3000 lamps fill the block that a writer holds with two tiles.
TEST_F(Archive, targets_of_more_lamps_than_a_block_holds_come_back) {
    auto writer = ArchiveWriter::create(path, take_info(3000));
    const Target target = numbered_target(3000, 200, 10, Cfa::none, 0);
    ASSERT_TRUE(writer->write_target(target).ok());
    const auto back = ArchiveReader::open(path)->read_target(0, 0);
    ASSERT_TRUE(back.ok()) << back.error().message;
    EXPECT_EQ(back->lamps, target.lamps);
}

TEST_F(Archive, the_same_take_gives_the_same_bytes) {
    for (const auto& copy : {path, path + "2"}) {
        auto writer = ArchiveWriter::create(copy, take_info(3));
        ASSERT_TRUE(writer->write_target(numbered_target(3, 130, 70, Cfa::rggb, 0)).ok());
        ASSERT_TRUE(writer->note_missing_target(0, 1, "lost").ok());
        ASSERT_TRUE(writer->finish().ok());
    }
    EXPECT_EQ(output_of("diff -r '" + path + "' '" + path + "2'"), "");
}

TEST_F(Archive, what_half_floats_cannot_hold_is_clamped_and_masked_and_never_inf) {
    auto writer = ArchiveWriter::create(path, take_info(1));
    Target target = numbered_target(1, 4, 1, Cfa::none, 0);
    target.lamps[0] = {1e6f, -std::numeric_limits<float>::infinity(), std::nanf(""), 65504};
    target.mask = {mask_saturated, 0, 0, 0};
    ASSERT_TRUE(writer->write_target(target).ok());
    const auto back = ArchiveReader::open(path)->read_target(0, 0);
    EXPECT_EQ(back->lamps[0], (Plane{65504, -65504, 0, 65504}));
    EXPECT_EQ(back->mask, (std::vector<uint32_t>{mask_saturated | mask_clamped, mask_clamped, mask_clamped, 0}));
}

TEST_F(Archive, exrheader_sees_layers_parts_and_film_attributes) {
    TakeInfo info = take_info(156);
    info.timecode_start = "01:00:00:22";
    info.production = "House on Fire";
    info.scene = "42A";
    auto writer = ArchiveWriter::create(path, info);
    ASSERT_TRUE(writer->write_target(numbered_target(156, 70, 65, Cfa::rggb, 3)).ok());
    const std::string header = output_of("exrheader '" + path + "/cam0/target_000003.exr'");
    for (const std::string expected :
         {"lamp_000.Y, 16-bit floating-point", "lamp_155.Y", "name (type string): \"lamps\"",
          "name (type string): \"mask\"", "name (type string): \"variance\"", "tiledimage", "64 by 64",
          "time 01:00:01:01", "24/1", "House on Fire", "42A", "colorInteropID", "rggb", "s159", "reflectance"})
        EXPECT_NE(header.find(expected), std::string::npos) << expected << "\n" << header.substr(0, 3000);
}

TEST_F(Archive, lights_are_written_by_layer_for_other_programs_and_by_name_in_the_manifest) {
    TakeInfo info = take_info(2);
    info.lights[0].name = "b last in the alphabet.png";
    info.lights[1].name = "a first.png";
    ASSERT_TRUE(ArchiveWriter::create(path, info)->finish().ok());
    const auto lights = read_lp(path + "/lights.lp");
    EXPECT_EQ((*lights)[0].name, "lamp_000");
    EXPECT_NEAR(length((*lights)[1].direction - info.lights[1].direction), 0, 2e-9);
    const auto reader = ArchiveReader::open(path);
    EXPECT_EQ(reader->info().lights[1].name, "a first.png");
    EXPECT_EQ(reader->info().lights[0].direction.z, info.lights[0].direction.z);
}

TEST_F(Archive, missing_targets_are_listed_with_their_reason) {
    auto writer = ArchiveWriter::create(path, take_info(2));
    ASSERT_TRUE(writer->write_target(numbered_target(2, 8, 8, Cfa::none, 1)).ok());
    ASSERT_TRUE(writer->note_missing_target(0, 0, "slot 17 was lost", {{"slots", {17}}}).ok());
    writer->add_to_manifest({{"identification", {{"frames", 180}}}});
    ASSERT_TRUE(writer->finish().ok());
    const auto reader = ArchiveReader::open(path);
    ASSERT_EQ(reader->targets().size(), 2u);
    EXPECT_EQ(reader->targets()[0].why_missing, "slot 17 was lost");
    EXPECT_EQ(reader->targets()[1].file, "cam0/target_000001.exr");
    EXPECT_EQ(reader->manifest()["targets"]["missing"][0]["detail"]["slots"][0], 17);
    EXPECT_EQ(reader->info().extra["identification"]["frames"], 180);
    EXPECT_NE(reader->read_target(0, 0).error().message.find("slot 17 was lost"), std::string::npos);
    EXPECT_EQ(reader->verify().problems, std::vector<std::string>{});
}

TEST_F(Archive, a_target_is_written_or_noted_once) {
    auto writer = ArchiveWriter::create(path, take_info(1));
    ASSERT_TRUE(writer->write_target(numbered_target(1, 8, 8, Cfa::none, 0)).ok());
    EXPECT_FALSE(writer->write_target(numbered_target(1, 8, 8, Cfa::none, 0)).ok());
    EXPECT_FALSE(writer->note_missing_target(0, 0, "lost").ok());
}

TEST_F(Archive, changed_shortened_vanished_and_strange_files_are_named) {
    auto writer = ArchiveWriter::create(path, take_info(1));
    for (uint32_t n = 0; n < 4; ++n) ASSERT_TRUE(writer->write_target(numbered_target(1, 8, 8, Cfa::none, n)).ok());
    ASSERT_TRUE(writer->finish().ok());
    const std::filesystem::path cam = path + "/cam0";
    flip_byte(cam / "target_000000.exr", 1500);
    std::filesystem::resize_file(cam / "target_000001.exr", 1000);
    std::filesystem::remove(cam / "target_000002.exr");
    std::ofstream(cam / "target_000009.exr.part") << "half of it";
    std::ofstream(cam / "target_000008.exr") << "unnoted";
    flip_byte(path + "/lights.lp", 4);
    flip_byte(path + "/manifest.json", 300);
    const auto found = ArchiveReader::open(path)->verify();
    EXPECT_EQ(found.intact, std::vector<std::string>{"cam0/target_000003.exr"});
    EXPECT_EQ(found.problems.size(), 7u);
    for (const std::string line :
         {"target_000000.exr: has CRC-32", "target_000001.exr: has 1000 bytes", "target_000002.exr' is gone",
          "target_000009.exr.part: was not finished", "target_000008.exr: is not in the journal", "lights.lp: has CRC",
          "manifest.json: has CRC"})
        EXPECT_TRUE(any_contains(found.problems, line)) << line;
}

TEST_F(Archive, a_torn_last_journal_line_is_named_and_hides_nothing_before_it) {
    {
        auto writer = ArchiveWriter::create(path, take_info(1));
        for (uint32_t n = 0; n < 2; ++n) ASSERT_TRUE(writer->write_target(numbered_target(1, 8, 8, Cfa::none, n)).ok());
    }
    const std::filesystem::path journal = path + "/journal.jsonl";
    std::filesystem::resize_file(journal, std::filesystem::file_size(journal) - 20);
    const auto reader = ArchiveReader::open(path);
    ASSERT_TRUE(reader.ok());
    EXPECT_FALSE(reader->finished());
    EXPECT_TRUE(reader->read_target(0, 0).ok());
    EXPECT_FALSE(reader->read_target(0, 1).ok());
    const auto found = reader->verify();
    EXPECT_EQ(found.intact, std::vector<std::string>{"cam0/target_000000.exr"});
    EXPECT_TRUE(any_contains(found.problems, "journal.jsonl:3: the line is torn"));
    EXPECT_TRUE(any_contains(found.problems, "target_000001.exr: is not in the journal"));
    EXPECT_TRUE(any_contains(found.problems, "has no end"));
}

TEST_F(Archive, a_journal_cannot_lead_out_of_its_archive) {
    ASSERT_TRUE(ArchiveWriter::create(path, take_info(1))->finish().ok());
    std::ofstream(path + "/journal.jsonl", std::ios::app)
        << R"({"event":"target","camera":0,"index":0,"file":"../../etc/passwd","bytes":1,"crc32":"00000000"})"
        << "\n";
    const auto reader = ArchiveReader::open(path);
    EXPECT_TRUE(reader->targets().empty());
    EXPECT_TRUE(any_contains(reader->verify().problems, "journal.jsonl:3"));
}

TEST_F(Archive, an_existing_path_is_refused_and_only_an_archive_is_overwritten) {
    ASSERT_TRUE(ArchiveWriter::create(path, take_info(1))->finish().ok());
    const auto refused = ArchiveWriter::create(path, take_info(1));
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find(path), std::string::npos);
    {
        auto overwritten = ArchiveWriter::create(path, take_info(1), true);
        ASSERT_TRUE(overwritten->write_target(numbered_target(1, 8, 8, Cfa::none, 0)).ok());
        std::ofstream(path + "/cam0/target_000001.exr.part") << "interrupted";
    }
    EXPECT_TRUE(ArchiveWriter::create(path, take_info(1), true).ok());
    EXPECT_FALSE(std::filesystem::exists(path + "/cam0"));

    std::ofstream(path + "/my notes.txt") << "keep me";
    const auto stranger = ArchiveWriter::create(path, take_info(1), true);
    ASSERT_FALSE(stranger.ok());
    EXPECT_NE(stranger.error().message.find("my notes.txt"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(path + "/manifest.json"));

    std::filesystem::create_directory(path + "2");
    EXPECT_FALSE(ArchiveWriter::create(path + "2", take_info(1), true).ok());
    EXPECT_TRUE(std::filesystem::exists(path + "2"));
}

TEST_F(Archive, what_is_no_archive_is_refused_by_name) {
    EXPECT_NE(ArchiveReader::open("/nonexistent.rfa").error().message.find("/nonexistent.rfa"), std::string::npos);
    std::filesystem::create_directory(path);
    EXPECT_NE(ArchiveReader::open(path).error().message.find("has no manifest.json"), std::string::npos);
    std::ofstream(path + "/manifest.json") << "{ not json";
    EXPECT_NE(ArchiveReader::open(path).error().message.find("not JSON"), std::string::npos);
    std::ofstream(path + "/manifest.json") << R"({"format":"open-light-stage-archive","version":2})";
    EXPECT_NE(ArchiveReader::open(path).error().message.find("slate"), std::string::npos);
    std::ofstream(path + "/manifest.json") << R"({"format":"open-light-stage-archive","version":9})";
    EXPECT_NE(ArchiveReader::open(path).error().message.find("later version"), std::string::npos);
}

TEST_F(Archive, a_wrong_timecode_is_refused_and_nothing_is_left) {
    TakeInfo info = take_info(1);
    info.timecode_start = "01:00:00:24";
    EXPECT_FALSE(ArchiveWriter::create(path, info).ok());
    EXPECT_FALSE(std::filesystem::exists(path));
}
