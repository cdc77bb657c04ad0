// SPDX-License-Identifier: MIT
// Journals, held against a chain that this test computes with zlib, and against every way in which lines can be wrong.
// links: ols_archive z
#include "archive/journal.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "archive/manifest.hpp"
#include "take_fixture.hpp"
#include "target_files.hpp"

using namespace ols;
using namespace ols::test;

class JournalReading : public TakeDirectory {
  protected:
    void SetUp() override {
        TakeDirectory::SetUp();
        auto writer = ArchiveWriter::create(path, take_info(2));
        ASSERT_TRUE(writer->expect_targets(0, 9).ok());
        for (const uint32_t index : {0, 1})
            ASSERT_TRUE(writer->write_target(numbered_target(2, 8, 8, Cfa::none, index)).ok());
        ASSERT_TRUE(writer->note_missing_target(0, 2, "lost", {{"slots", {7}}}).ok());
        ASSERT_TRUE(writer->note_missing_targets(0, 3, 8, "the take ended").ok());
        ASSERT_TRUE(writer->finish().ok());
        text = read_text(path + "/journal.jsonl");
        lines = lines_of(text);
        ASSERT_EQ(lines.size(), 7u);
    }

    Verification verify(const std::string& journal) {
        write_text(path + "/journal.jsonl", journal);
        const auto archive = ArchiveReader::open(path);
        return archive ? archive->verify() : Verification{{}, {archive.error().message}, {}};
    }

    // The problems of the journal with one line replaced and all chains right.
    std::string problems_of(size_t line, const std::function<void(nlohmann::json&)>& change) {
        auto changed = lines;
        auto json = nlohmann::json::parse(lines[line]);
        change(json);
        json.erase("chain");
        changed[line] = json.dump();
        return joined(verify(chained(changed)).problems);
    }

    std::string text;
    std::vector<std::string> lines;
};

TEST_F(JournalReading, every_line_ends_with_the_crc32_of_all_bytes_before_its_chain) {
    EXPECT_EQ(chained(lines), text);
    EXPECT_EQ(verify(text).problems, std::vector<std::string>{});
}

TEST_F(JournalReading, a_line_removed_doubled_or_moved_is_found_and_the_targets_stay_readable) {
    for (size_t i = 0; i < lines.size(); ++i) {
        auto removed = lines, doubled = lines, blank = lines;
        removed.erase(removed.begin() + std::ptrdiff_t(i));
        doubled.insert(doubled.begin() + std::ptrdiff_t(i), lines[i]);
        blank[i] = "";
        for (const auto& changed : {removed, doubled, blank})
            EXPECT_NE(joined(verify(joined(changed)).problems), "") << i;
        for (size_t k = i + 1; k < lines.size(); ++k) {
            auto swapped = lines;
            std::swap(swapped[i], swapped[k]);
            const auto found = verify(joined(swapped));
            EXPECT_NE(joined(found.problems), "") << i << " " << k;
            if (i > 0 && k < lines.size() - 1) {
                EXPECT_EQ(found.intact.size(), 2u) << joined(found.problems);
            }
        }
    }
}

// One byte changed: where, so that the user can look there, and not in every line behind it, too.
TEST_F(JournalReading, one_damaged_line_is_told_and_not_all_that_follow) {
    auto changed = lines;
    changed[4].replace(changed[4].find("lost"), 4, "last");
    const auto problems = verify(joined(changed)).problems;
    ASSERT_EQ(problems.size(), 1u) << joined(problems);
    EXPECT_NE(problems[0].find("journal.jsonl:5 does not follow"), std::string::npos) << problems[0];
}

TEST_F(JournalReading, what_lines_say_together_must_agree_even_where_the_chain_does) {
    const auto expect = [&](size_t line, const char* problem, const std::function<void(nlohmann::json&)>& change) {
        const std::string problems = problems_of(line, change);
        EXPECT_NE(problems.find(problem), std::string::npos) << problems;
    };
    expect(0, "is none of this version", [](auto& json) { json["event"] = "start"; });
    expect(0, "is no begin", [](auto& json) { json["event"] = "start"; });
    expect(0, "version is not the manifest's", [](auto& json) { json["version"] = 99; });
    expect(0, "lights is missing", [](auto& json) { json.erase("lights"); });
    expect(0, "lights.crc32 is not eight digits", [](auto& json) { json["lights"]["crc32"] = "1234567"; });
    expect(0, "lights.crc32 is not eight digits", [](auto& json) { json["lights"]["crc32"] = "1234567G"; });
    expect(1, "camera 0: targets 9 to 11 never finished", [](auto& json) { json["targets"] = 12; });
    expect(1, "which was to have 3", [](auto& json) { json["targets"] = 3; });
    expect(2, "index is a negative number", [](auto& json) { json["index"] = -1; });
    expect(2, "bytes is a number with a fraction", [](auto& json) { json["bytes"] = 1e300; });
    expect(2, "index is 4294967296, beyond", [](auto& json) { json["index"] = uint64_t(1) << 32; });
    expect(2, "file is not 'cam0/target_000000.exr'", [](auto& json) { json["file"] = "../x.exr"; });
    expect(2, "file is not", [](auto& json) { json["file"] = std::string("cam0/target_000000.exr\0", 23); });
    expect(2, "file is not", [](auto& json) { json["file"] = "/etc/passwd"; });
    expect(2, "file is a whole number, not a text", [](auto& json) { json["file"] = 5; });
    expect(2, "crc32 is missing", [](auto& json) { json.erase("crc32"); });
    expect(2, "provenance is missing", [](auto& json) { json.erase("provenance"); });
    expect(2, "notes is no key", [](auto& json) { json["notes"] = 1; });
    expect(3, "is noted twice", [&](auto& json) { json = nlohmann::json::parse(lines[2]); });
    expect(5, "through comes before index", [](auto& json) { json["through"] = 1; });
    expect(5, "is noted twice", [](auto& json) { json["index"] = 1; });
    expect(6, "its end says that 3 targets are written", [](auto& json) { json["written"] = 3; });
    expect(6, "its end says that 8 targets are missing", [](auto& json) { json["missing"] = 8; });
    expect(6, "manifest.json: has", [](auto& json) { json["manifest"]["bytes"] = 7; });
    expect(4, "stands behind the end", [&](auto& json) { json = nlohmann::json::parse(lines[6]); });
    expect(4, "is a begin, which stands first", [&](auto& json) { json = nlohmann::json::parse(lines[0]); });
    expect(4, "was told of before", [&](auto& json) { json = nlohmann::json::parse(lines[1]); });
}

TEST_F(JournalReading, text_that_is_no_json_of_ours_is_an_error_that_names_file_and_line) {
    const std::string deep(100'000, '[');
    for (const std::string& line :
         {std::string("garbage"), std::string("\xff\xfe"), std::string("[1]"), std::string("null"),
          "{\"event\":" + deep, std::string(R"({"event":"end","event":"end"})"),
          std::string(R"({"event":"end","written":1e400})"), std::string(R"({"event":NaN})"),
          std::string(R"({"event":"\ud800"})"), std::string("{\"event\":\"\xc3\"}")}) {
        auto changed = lines;
        changed[3] = line;
        const std::string problems = joined(verify(joined(changed)).problems);
        EXPECT_NE(problems.find("journal.jsonl:4 is damaged"), std::string::npos) << problems.substr(0, 2000);
    }
}

TEST_F(JournalReading, a_file_of_new_lines_or_without_any_is_told_in_few_words) {
    const auto newlines = verify(std::string(1 << 20, '\n'));
    EXPECT_LT(newlines.problems.size(), 120u);
    EXPECT_NE(joined(newlines.problems).find("the rest was not looked at"), std::string::npos);
    EXPECT_NE(joined(verify("").problems).find("journal.jsonl: is empty"), std::string::npos);
    EXPECT_NE(joined(verify(std::string(20 << 20, 'x')).problems).find("longer than"), std::string::npos);
}

// The last write of a process that was killed.
TEST_F(JournalReading, a_line_torn_anywhere_is_an_interruption_and_no_damage) {
    for (size_t bytes = text.find('\n') + 1; bytes < text.size(); bytes += 7) {
        const auto found = verify(text.substr(0, bytes));
        for (const auto& problem : found.problems)
            EXPECT_TRUE(problem.find("torn") != std::string::npos || problem.find("no end") != std::string::npos ||
                        problem.find("never finished") != std::string::npos ||
                        problem.find("is not in the journal") != std::string::npos)
                << bytes << ": " << problem;
    }
}

TEST_F(JournalReading, an_archive_of_version_1_is_read_and_verify_says_what_it_cannot_know) {
    auto manifest = nlohmann::json::parse(read_text(path + "/manifest.json"));
    manifest["version"] = 1;
    const std::string manifest_text = manifest.dump(1) + "\n";
    write_text(path + "/manifest.json", manifest_text);
    std::string old;
    for (const auto& line : lines) {
        auto json = nlohmann::json::parse(line);
        json.erase("chain");
        if (json["event"] == "begin") json["version"] = 1, json.erase("manifest");
        if (json["event"] == "end") json["manifest"] = to_json(checksum_text(manifest_text));
        old += json.dump() + "\n";
    }
    const auto found = verify(old);
    EXPECT_EQ(found.problems, std::vector<std::string>{});
    EXPECT_EQ(found.intact.size(), 2u);
    ASSERT_EQ(found.notes.size(), 1u);
    EXPECT_NE(found.notes[0].find("not chained"), std::string::npos);
    // What the counts show, shows.
    auto removed = lines_of(old);
    removed.erase(removed.begin() + 2);
    EXPECT_NE(joined(verify(joined(removed)).problems).find("never finished"), std::string::npos);
}
