// SPDX-License-Identifier: MIT
// Archives changed in every way that a list can name. Each is read as what it was, read as what the changed text says, or refused;
// `verify` finds every change that the journal was not made to agree with. What came of how many is in the test's properties.
// links: ols_archive z
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>

#include "archive/manifest.hpp"
#include "take_fixture.hpp"
#include "target_files.hpp"

using namespace ols;
using namespace ols::test;
using nlohmann::json;

namespace {

constexpr int targets = 2;
const std::string foreign_text = "\xff";

class ArchiveMutations : public TakeDirectory {
  protected:
    void SetUp() override {
        TakeDirectory::SetUp();
        write_take(path, 0);
        manifest = read_text(path + "/manifest.json");
        journal = read_text(path + "/journal.jsonl");
        for (uint32_t i = 0; i < targets; ++i) files.push_back(read_text(file_of(i)));
    }
    void TearDown() override {
        for (const auto& [outcome, count] : counts) {
            RecordProperty(outcome, count);
            std::printf("    %s: %d\n", outcome.c_str(), count);
        }
        TakeDirectory::TearDown();
    }

    std::string file_of(uint32_t index) const { return path + "/cam0/target_00000" + std::to_string(index) + ".exr"; }

    static Target target_of(uint32_t index) { return numbered_target(2, 9, 7, Cfa::rggb, index); }
    static void write_take(const std::string& place, uint32_t first) {
        TakeInfo info = take_info(2);
        info.production = "a \"film\"";
        info.extra = {{"basis", {{"rows", 2}}}, {"seconds", {1, 2.5}}};
        auto writer = ArchiveWriter::create(place, info);
        ASSERT_TRUE(writer->expect_targets(0, 5).ok());
        for (uint32_t i = 0; i < targets; ++i) {
            Target target = target_of(i);
            target.provenance["first"] = first;
            ASSERT_TRUE(writer->write_target(target).ok());
        }
        ASSERT_TRUE(writer->note_missing_target(0, 2, "lost", {{"slots", {7}}}).ok());
        ASSERT_TRUE(writer->note_missing_targets(0, 3, 4, "ended").ok());
        ASSERT_TRUE(writer->finish().ok());
    }
    void restore() {
        write_text(path + "/manifest.json", manifest);
        write_text(path + "/journal.jsonl", journal);
        for (uint32_t i = 0; i < targets; ++i) write_text(file_of(i), files[i]);
    }

    // A change that the journal was not made to agree with: verify names it, and a target is as it was or is not read.
    void expect_found(const std::string& change) {
        const auto archive = ArchiveReader::open(path);
        if (!archive) {
            EXPECT_NE(archive.error().message.find(path), std::string::npos) << archive.error().message;
            ++counts["refused_whole"];
            return;
        }
        EXPECT_FALSE(archive->verify().problems.empty()) << change;
        for (uint32_t i = 0; i < targets; ++i) {
            const auto target = archive->read_target(0, i);
            ++counts[target ? "targets_as_they_were" : "targets_refused"];
            if (!target) continue;
            EXPECT_EQ(target->lamps, target_of(i).lamps) << change;
            EXPECT_EQ(target->mask, target_of(i).mask) << change;
        }
    }

    std::string manifest, journal;
    std::vector<std::string> files;
    std::map<std::string, int> counts;
};

std::vector<json::json_pointer> places_in(const json& value) {
    std::vector<json::json_pointer> places;
    const json leaves = value.flatten();
    for (const auto& [place, leaf] : leaves.items())
        for (json::json_pointer at(place); !at.empty(); at = at.parent_pointer())
            if (std::ranges::find(places, at) == places.end()) places.push_back(at);
    return places;
}

void erase(json& value, const json::json_pointer& at) {
    json& parent = value[at.parent_pointer()];
    if (parent.is_array())
        parent.erase(size_t(std::stoul(at.back())));
    else
        parent.erase(at.back());
}

}  // namespace

TEST_F(ArchiveMutations, one_bit_of_any_byte_of_the_journal) {
    for (size_t i = 0; i < journal.size(); ++i) {
        std::string changed = journal;
        changed[i] = char(changed[i] ^ (1 << (i % 8)));
        write_text(path + "/journal.jsonl", changed);
        expect_found("bit " + std::to_string(i % 8) + " of byte " + std::to_string(i));
    }
}

TEST_F(ArchiveMutations, one_bit_of_any_byte_of_the_manifest) {
    for (size_t i = 0; i < manifest.size(); ++i) {
        std::string changed = manifest;
        changed[i] = char(changed[i] ^ (1 << (i % 8)));
        write_text(path + "/manifest.json", changed);
        expect_found("bit " + std::to_string(i % 8) + " of byte " + std::to_string(i));
    }
}

TEST_F(ArchiveMutations, one_bit_of_bytes_all_over_a_target) {
    for (size_t i = 0; i < files[0].size(); i += 7) {
        std::string changed = files[0];
        changed[i] = char(changed[i] ^ (1 << (i % 8)));
        write_text(file_of(0), changed);
        expect_found("byte " + std::to_string(i));
    }
    EXPECT_EQ(counts["targets_as_they_were"], counts["targets_refused"]);  // the other, and this one
}

// Without the checksum: nothing but an error or a target of this size may come of it.
TEST_F(ArchiveMutations, one_bit_of_bytes_all_over_a_target_that_is_read_unchecked) {
    for (size_t i = 0; i < files[0].size(); i += 5) {
        std::string changed = files[0];
        changed[i] = char(changed[i] ^ (1 << (i % 8)));
        write_text(file_of(0), changed);
        const auto archive = ArchiveReader::open(path);
        const auto opened = archive->open_target(0, 0, TargetCheck::size);
        const auto target = opened ? opened->read() : Result<Target>(opened.error());
        ++counts[target ? "read_with_other_samples_or_the_same" : "refused"];
        if (target) {
            EXPECT_EQ(target->lamps.size(), 2u);
            EXPECT_EQ(target->lamps[1].size(), 63u);
        } else {
            EXPECT_NE(target.error().message.find("target_000000.exr"), std::string::npos);
        }
    }
}

TEST_F(ArchiveMutations, lines_of_the_journal_removed_doubled_and_swapped) {
    const auto lines = lines_of(journal);
    for (size_t i = 0; i < lines.size(); ++i)
        for (size_t k = 0; k < lines.size(); ++k) {
            auto moved = lines;
            if (i == k)
                moved.erase(moved.begin() + std::ptrdiff_t(i));
            else
                std::swap(moved[i], moved[k]);
            write_text(path + "/journal.jsonl", joined(moved));
            expect_found("lines " + std::to_string(i) + " and " + std::to_string(k));
            auto doubled = lines;
            doubled.insert(doubled.begin() + std::ptrdiff_t(k), lines[i]);
            write_text(path + "/journal.jsonl", joined(doubled));
            expect_found("line " + std::to_string(i) + " again before " + std::to_string(k));
        }
}

TEST_F(ArchiveMutations, files_of_other_targets_and_other_takes) {
    write_take(directory + "/other.rfa", 1);
    const std::string other = directory + "/other.rfa/";
    write_text(file_of(0), files[1]);
    expect_found("target 1 for target 0");
    // Even where the journal agrees.
    auto lines = lines_of(journal);
    for (auto& line : lines)
        if (auto entry = json::parse(line); entry["event"] == "target" && entry["index"] == 0) {
            entry.update(zlib_checksum(files[1]));
            entry.erase("chain");
            line = entry.dump();
        }
    write_text(path + "/journal.jsonl", chained(lines));
    const auto archive = ArchiveReader::open(path);
    EXPECT_NE(archive->read_target(0, 0).error().message.find("stands in the place of index 0"), std::string::npos);
    EXPECT_EQ(archive->verify().intact.size(), 1u);
    for (const char* name : {"journal.jsonl", "cam0/target_000000.exr", "cam0/target_000001.exr"}) {
        restore();
        write_text(path + "/" + name, read_text(other + name));
        expect_found(name);
    }
}

// A manifest with any value of another kind, and a journal that agrees: what it says is what is read, or the key is named.
TEST_F(ArchiveMutations, every_value_of_the_manifest_of_every_kind) {
    const json good = json::parse(manifest);
    const json values = {nullptr,
                         true,
                         -1,
                         0,
                         7,
                         0.5,
                         1e300,
                         18446744073709551615u,
                         "",
                         "x",
                         std::string(100'000, 'y'),
                         json::array(),
                         json::object(),
                         {{"a", 1}},
                         {1, 2, 3},
                         {{1}, {2}}};
    const auto try_it = [&](const json::json_pointer& at, const json& changed) {
        write_text(path + "/manifest.json", changed.dump());
        auto lines = lines_of(journal);
        auto end = json::parse(lines.back());
        end.erase("chain");
        end["manifest"] = zlib_checksum(changed.dump());
        lines.back() = end.dump();
        write_text(path + "/journal.jsonl", chained(lines));
        const auto archive = ArchiveReader::open(path);
        if (!archive) {
            ++counts["refused"];
            const std::string& message = archive.error().message;
            EXPECT_NE(message.find("manifest.json"), std::string::npos) << message;
            const auto key = at.to_string().substr(1, at.to_string().find('/', 1) - 1);
            EXPECT_TRUE(message.find(key) != std::string::npos || key == "format") << at.to_string() << ": " << message;
            return;
        }
        // Direction and numbers are of a double's digits; what read_manifest() made of the text is written again.
        json again = manifest_of(archive->info());
        again["version"] = changed["version"];
        if (changed.contains("targets")) again["targets"] = changed["targets"];
        const bool is_same = again == changed;
        const bool is_told = !archive->verify().problems.empty();
        ++counts[is_same ? "read_as_it_says" : "told_by_verify"];
        EXPECT_TRUE(is_same || is_told) << at.to_string() << ": " << changed[at].dump().substr(0, 100);
    };
    for (const auto& at : places_in(good)) {
        for (const json& value : values) {
            json changed = good;
            if (changed[at] == value) continue;
            changed[at] = value;
            try_it(at, changed);
        }
        json changed = good;
        erase(changed, at);
        try_it(at, changed);
        if (!good[at].is_object()) continue;
        changed = good;
        changed[at]["unheard_of"] = 1;
        try_it(at, changed);
    }
}

TEST_F(ArchiveMutations, text_that_no_json_is) {
    const std::string nested(100'000, '['), before = "{\"format\":\"open-light-stage-archive\",\"extra\":";
    for (const std::string& text :
         {nested, before + nested, before + std::string(100'000, '{') + "}", before + "NaN}", before + "1e999}",
          before + "{\"a\":1,\"a\":2}}", before + "\"" + foreign_text + "\"}", std::string(), std::string("\0", 1),
          manifest.substr(0, manifest.size() / 2), manifest + manifest, "\xef\xbb\xbf" + before}) {
        write_text(path + "/manifest.json", text);
        const auto archive = ArchiveReader::open(path);
        ASSERT_FALSE(archive.ok()) << text.substr(0, 100);
        EXPECT_NE(archive.error().message.find("manifest.json"), std::string::npos) << archive.error().message;
        ++counts["refused"];
    }
}
