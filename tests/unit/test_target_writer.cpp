// SPDX-License-Identifier: MIT
// Every target of a take is in its journal, whatever the disk does (rule 5): on disks of all sizes that matter.
// links: ols_take
#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "small_disk.hpp"
#include "take/target_writer.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

// Counts what is not as it must be: 1 where any target is unnamed, or the archive is not sound and finished.
int check(const std::string& path, uint32_t targets, const TargetWriter::Report& report) {
    const auto reader = ArchiveReader::open(path);
    if (!reader || !reader->finished() || !reader->undecided().empty()) return 1;
    const auto found = reader->verify();
    if (!found.problems.empty() || int(found.intact.size()) != report.written) return 2;
    std::set<uint32_t> named;
    for (const auto& entry : reader->targets()) {
        for (uint32_t index = entry.index; index <= entry.last; ++index) named.insert(index);
        if (entry.file.empty() && entry.why_missing.find("No space left") == std::string::npos) return 3;
    }
    if (named.size() != targets || report.written + report.missing != int(targets)) return 4;
    uint64_t in_manifest = 0;
    for (const auto& run : reader->manifest().at("targets").at("missing"))
        in_manifest += run.value("through", run.at("index").get<uint32_t>()) - run.at("index").get<uint32_t>() + 1;
    if (in_manifest != uint64_t(report.missing)) return 5;
    return (report.missing > 0) == report.error.empty() ? 6 : 0;
}

// A take of targets, some of them too large for what is left. What else takes room is the tester's: a file that grows until the
// disk is full, once all is begun.
int record_take_onto(const std::string& path, uint32_t targets, bool disk_fills_up) {
    auto archive = ArchiveWriter::create(path, take_info(3));
    if (!archive) return archive.error().message.find("No space left") != std::string::npos ? 0 : 10;
    if (!archive->expect_targets(0, targets)) return 0;
    const std::string other = std::filesystem::path(path).parent_path() / "other";
    if (disk_fills_up) {
        std::FILE* file = std::fopen(other.c_str(), "w");
        char byte = 0;
        while (std::fwrite(&byte, 1, 1, file) == 1 && std::fflush(file) == 0) {
        }
        std::fclose(file);
    }
    TargetWriter::Report report;
    {
        StageBeats beats;
        OutputMonitor monitor(beats, 0, 1, 57'870);
        ArchiveSink sink(*archive);
        TargetWriter writer(sink, monitor);
        for (uint32_t index = 0; index < targets; ++index) {
            TargetOutcome outcome{0, index, nullptr, "", {{"cycle", index}, {"padding", std::string(3000, 'p')}}};
            outcome.target =
                std::make_unique<Target>(numbered_target(3, 32 + 16 * int(index % 4), 64, Cfa::rggb, index));
            outcome.target->provenance = outcome.detail;
            writer.add(std::move(outcome));
        }
        report = writer.finish();
    }
    if (const auto finished = archive->finish(); !finished) return 11;
    return check(path, targets, report);
}

}  // namespace

class SmallDisks : public TakeDirectory {};

TEST_F(SmallDisks, every_target_that_a_disk_of_any_size_takes_is_named_and_the_archive_is_sound) {
    int taken_by_some = 0;
    for (int64_t size = 1'080'000; size < 1'900'000; size += 24'571) {
        const int code = on_small_disk(directory, size, [&] { return record_take_onto(path, 12, false); });
        if (code == no_mount) GTEST_SKIP() << "mounting a small disk needs rights that are not given here";
        EXPECT_EQ(code, 0) << "on a disk of " << size << " bytes";
        ++taken_by_some;
    }
    EXPECT_GT(taken_by_some, 30);
}

TEST_F(SmallDisks, a_disk_that_another_program_fills_to_the_last_byte_still_takes_the_names_and_the_end) {
    // More targets than the room set aside would hold lines.
    for (const uint32_t targets : {12u, 800u}) {
        const int code = on_small_disk(directory, 3 << 20, [&] { return record_take_onto(path, targets, true); });
        if (code == no_mount) GTEST_SKIP() << "mounting a small disk needs rights that are not given here";
        EXPECT_EQ(code, 0);
    }
}

TEST_F(SmallDisks, what_could_not_be_written_first_is_told_to_whoever_looks_at_the_running_take) {
    auto archive = ArchiveWriter::create(path, take_info(1));
    std::ofstream(path + "/cam0") << "no folder";
    StageBeats beats;
    OutputMonitor monitor(beats, 0, 1, 57'870);
    ArchiveSink sink(*archive);
    TargetWriter writer(sink, monitor);
    for (uint32_t index : {0u, 1u})
        writer.add(
            TargetOutcome{0, index, std::make_unique<Target>(numbered_target(1, 8, 8, Cfa::none, index)), "", {}});
    const auto report = writer.finish();
    EXPECT_EQ(report.missing, 2);
    EXPECT_EQ(monitor.progress().write_error, report.error);
    EXPECT_TRUE(report.error.starts_with("target 0: ")) << report.error;
    EXPECT_NE(report.error.find("Not a directory"), std::string::npos) << report.error;
}

TEST_F(SmallDisks, runs_of_targets_that_were_never_recorded_are_one_line_and_one_entry) {
    auto archive = ArchiveWriter::create(path, take_info(1));
    ASSERT_TRUE(archive->expect_targets(0, 1'000'000).ok());
    StageBeats beats;
    OutputMonitor monitor(beats, 0, 1, 57'870);
    ArchiveSink sink(*archive);
    TargetWriter writer(sink, monitor);
    writer.add(TargetOutcome{0, 0, std::make_unique<Target>(numbered_target(1, 8, 8, Cfa::none, 0)), "", {}});
    writer.add(LostTargets{0, 1, 999'999, "no frame of it was recorded: the take was stopped"});
    const auto report = writer.finish();
    ASSERT_TRUE(archive->finish().ok());
    EXPECT_EQ(report.missing, 999'999);
    EXPECT_EQ(monitor.progress().targets_written, 1u);
    EXPECT_EQ(monitor.progress().targets_missing, 999'999u);
    EXPECT_LT(std::filesystem::file_size(path + "/journal.jsonl"), 2000u);
    const auto reader = ArchiveReader::open(path);
    ASSERT_EQ(reader->targets().size(), 2u);
    EXPECT_EQ(target_words(reader->targets()[1]), "targets 1 to 999999");
    EXPECT_TRUE(reader->undecided().empty());
    EXPECT_NE(reader->read_target(0, 77).error().message.find("the take was stopped"), std::string::npos);
    EXPECT_TRUE(reader->verify().problems.empty());
}
