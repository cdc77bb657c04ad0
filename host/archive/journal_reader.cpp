// SPDX-License-Identifier: MIT
// Strict reading of journals: each line by itself, then what all of them say together.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string_view>

#include "archive/archive_file.hpp"
#include "archive/journal.hpp"
#include "archive/target_file.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

constexpr size_t line_bytes_max = 16 << 20;
// A file that is no journal at all could have a problem in every other byte: it is read no further.
constexpr size_t problems_max = 100;
constexpr uint64_t number_max = std::numeric_limits<uint32_t>::max();

// The lines of a file, one by one.
class Lines {
  public:
    explicit Lines(const ArchiveFile& file) : file_(file) {}

    // The next line without its new line; false at the end.
    Result<bool> next(std::string& line) {
        for (size_t looked_at = begin_;;) {
            if (const size_t end = read_.find('\n', looked_at); end != std::string::npos) {
                line = read_.substr(begin_, end - begin_);
                begin_ = end + 1;
                return true;
            }
            read_.erase(0, begin_);
            begin_ = 0;
            looked_at = read_.size();
            if (looked_at > line_bytes_max) return fail(fmt::format("a line is longer than {} bytes", line_bytes_max));
            read_.resize(looked_at + block_bytes);
            const auto bytes = file_.read(offset_, read_.data() + looked_at, block_bytes);
            read_.resize(looked_at + (bytes ? *bytes : 0));
            if (!bytes) return bytes.error();
            if (*bytes == 0) return false;
            offset_ += *bytes;
        }
    }

    // At the end: whether something stands behind the last new line.
    bool is_torn() const { return !read_.empty(); }

  private:
    static constexpr size_t block_bytes = 1 << 16;
    const ArchiveFile& file_;
    uint64_t offset_ = 0;
    std::string read_;
    size_t begin_ = 0;  // of what no line has been made of
};

// The CRC-32 in the chain that a line ends with; nothing where it does not.
std::optional<uint32_t> chain_of(std::string_view line) {
    const std::string pattern = chain_text(0);
    if (line.size() < pattern.size()) return std::nullopt;
    const std::string_view end = line.substr(line.size() - pattern.size());
    const auto crc32 = crc32_from_hex(end.substr(pattern.find('0'), 8));
    return crc32 && end == chain_text(*crc32) ? crc32 : std::nullopt;
}

std::optional<Checksum> checksum_of(JsonObject json) {
    Checksum sum{json.count("bytes", std::numeric_limits<int64_t>::max()), 0};
    const auto crc32 = crc32_from_hex(json.text("crc32"));
    if (!crc32) {
        json.reject("crc32", "is not eight digits 0-9 a-f");
        return std::nullopt;
    }
    sum.crc32 = *crc32;
    return sum;
}

TargetEntry target_entry(JsonObject& line) {
    TargetEntry entry;
    entry.camera = uint32_t(line.count("camera", number_max));
    entry.index = entry.last = uint32_t(line.count("index", number_max));
    return entry;
}

TargetEntry finished_entry(JsonObject& line) {
    TargetEntry entry = target_entry(line);
    entry.file = line.text("file");
    // A journal that was tampered with must not lead out of the archive.
    if (const auto name = target_file_name(entry.camera, entry.index); entry.file != name)
        line.reject("file", "is not '" + name + "'");
    const Checksum sum = checksum_of(line).value_or(Checksum{});
    entry.bytes = sum.bytes, entry.crc32 = sum.crc32;
    entry.detail = line.any("provenance");
    if (!entry.detail.is_object() && !entry.detail.is_null()) line.reject("provenance", "is not an object");
    return entry;
}

TargetEntry missing_entry(JsonObject& line) {
    TargetEntry entry = target_entry(line);
    if (line.has("through")) entry.last = uint32_t(line.count("through", number_max));
    if (entry.last < entry.index) line.reject("through", "comes before index");
    entry.why_missing = line.text("why");
    entry.detail = line.has("detail") ? line.any("detail") : nlohmann::json::object();
    return entry;
}

// Takes the lines of a journal in.
class Parser {
  public:
    Parser(int version, Journal& journal) : version_(version), journal_(journal) {}

    void take(const std::string& line) {
        ++number_;
        if (version_ >= 2) check_chain(line);
        const auto json = parse_json(line, where());
        const Status taken = json ? take(JsonObject(*json, where())) : json.error();
        if (!taken) add_problem(taken.error().message);
    }

    void tear() {
        journal_.torn =
            fmt::format("{}:{}: the line is torn: what it noted was not finished", journal_name, number_ + 1);
    }

    void finish() {
        if (number_ == 0) add_problem(fmt::format("{}: is empty", journal_name));
        sort_targets();
        check_expected();
        if (journal_.ended) check_counts();
        if (was_cut_short_)
            journal_.problems.push_back(
                fmt::format("{}: has more than {} problems: the rest was not looked at", journal_name, problems_max));
    }

    void add_problem(const std::string& problem) {
        if (journal_.problems.size() < problems_max)
            journal_.problems.push_back(problem);
        else
            was_cut_short_ = true;
    }
    bool is_hopeless() const { return was_cut_short_; }

  private:
    std::string where() const { return fmt::format("{}:{}", journal_name, number_); }

    void check_chain(const std::string& line) {
        const auto stated = chain_of(line);
        const size_t body_bytes = line.size() - (stated ? chain_text(*stated).size() : 0);
        const uint32_t body = crc32_of(before_, line.data(), body_bytes);
        if (!stated)
            add_problem(where() + " is damaged: it does not end with its chain");
        else if (*stated != body)
            add_problem(where() +
                        " does not follow from what is before it: a line was changed, removed, doubled or moved");
        // The lines behind are held against what this one says of those before it, so that one damage is told once.
        const std::string end = line.substr(body_bytes) + "\n";
        before_ = crc32_of(stated.value_or(body), end.data(), end.size());
    }

    // An error where the line is none of a journal.
    Status take(JsonObject line) {
        const std::string event = line.text("event");
        if (version_ >= 2) (void)line.text("chain");
        if (number_ == 1 && event != "begin") add_problem(where() + ": is no begin: lines before it are gone");
        if (journal_.ended) add_problem(where() + ": stands behind the end");
        if (event == "begin") return take_begin(line);
        if (event == "expect") return take_expected(line);
        if (event == "target") return take_target(finished_entry(line), line);
        if (event == "missing") return take_target(missing_entry(line), line);
        if (event == "end") return take_end(line);
        line.reject("event", "is none of this version");
        return line.finish();
    }

    Status take_begin(JsonObject& line) {
        if (number_ != 1) line.reject("event", "is a begin, which stands first and once");
        if (line.count("version", number_max) != uint64_t(version_)) line.reject("version", "is not the manifest's");
        const auto lights = checksum_of(line.object("lights"));
        const auto manifest = version_ >= 2 ? checksum_of(line.object("manifest")) : std::nullopt;
        if (const Status whole = line.finish(); !whole) return whole;
        journal_.lights = lights, journal_.manifest = manifest;
        return Done{};
    }

    Status take_expected(JsonObject& line) {
        const auto camera = uint32_t(line.count("camera", number_max)),
                   targets = uint32_t(line.count("targets", number_max));
        if (journal_.expected.contains(camera)) line.reject("camera", "was told of before");
        if (const Status whole = line.finish(); !whole) return whole;
        journal_.expected[camera] = targets;
        return Done{};
    }

    Status take_target(TargetEntry entry, JsonObject& line) {
        if (const Status whole = line.finish(); !whole) return whole;
        journal_.targets.push_back(std::move(entry));
        return Done{};
    }

    Status take_end(JsonObject& line) {
        const uint64_t written = line.count("written", number_max);
        const uint64_t missing = line.count("missing", std::numeric_limits<int64_t>::max());
        const auto manifest = checksum_of(line.object("manifest"));
        if (const Status whole = line.finish(); !whole) return whole;
        journal_.ended = true;
        journal_.manifest = manifest;
        written_ = written, missing_ = missing;
        return Done{};
    }

    void sort_targets() {
        auto& targets = journal_.targets;
        std::stable_sort(targets.begin(), targets.end(), [](const auto& a, const auto& b) {
            return std::pair(a.camera, a.index) < std::pair(b.camera, b.index);
        });
        std::vector<TargetEntry> once;
        for (auto& entry : targets) {
            if (!once.empty() && once.back().camera == entry.camera && entry.index <= once.back().last)
                add_problem(
                    fmt::format("{}: {} of camera {} is noted twice", journal_name, target_words(entry), entry.camera));
            else
                once.push_back(std::move(entry));
        }
        targets = std::move(once);
    }

    void check_expected() {
        for (const auto& entry : journal_.targets) {
            const auto expected = journal_.expected.find(entry.camera);
            if (expected != journal_.expected.end() && entry.last >= expected->second)
                add_problem(fmt::format("{}: notes {} of camera {}, which was to have {}", journal_name,
                                        target_words(entry), entry.camera, expected->second));
        }
    }

    void check_counts() {
        const auto check = [&](const char* what, uint64_t stated, uint64_t counted) {
            if (stated != counted)
                add_problem(fmt::format("{}: its end says that {} targets are {}, and its lines that {} are",
                                        journal_name, stated, what, counted));
        };
        check("written", written_, count_finished(journal_));
        check("missing", missing_, count_missing(journal_));
    }

    const int version_;
    Journal& journal_;
    int number_ = 0;
    uint32_t before_ = 0;  // the CRC-32 of all lines so far, as far as they agree
    uint64_t written_ = 0, missing_ = 0;
    bool was_cut_short_ = false;  // there was a problem too many
};

}  // namespace

Result<Journal> read_journal(const std::filesystem::path& root, int version) {
    const auto file = ArchiveFile::open(root, journal_name);
    if (!file) return file.error();
    Journal journal;
    Parser parser(version, journal);
    Lines lines(*file);
    std::string line;
    for (;;) {
        const auto more = lines.next(line);
        if (!more) {
            parser.add_problem(fmt::format("{}: {}: what is behind was not read", journal_name, more.error().message));
            break;
        }
        if (!*more) {
            if (lines.is_torn()) parser.tear();
            break;
        }
        parser.take(line);
        if (parser.is_hopeless()) break;
    }
    parser.finish();
    return journal;
}

uint64_t count_finished(const Journal& journal) {
    return uint64_t(std::ranges::count_if(journal.targets, [](const auto& entry) { return !entry.file.empty(); }));
}

uint64_t count_missing(const Journal& journal) {
    uint64_t count = 0;
    for (const auto& entry : journal.targets)
        if (entry.file.empty()) count += uint64_t(entry.last) - entry.index + 1;
    return count;
}

std::vector<TargetEntry> undecided_targets(const Journal& journal) {
    std::vector<TargetEntry> runs;
    for (const auto& [camera, count] : journal.expected) {
        uint64_t next = 0;  // everything before it is decided or in a run
        const auto add_run_to = [&, camera = camera](uint64_t end) {
            if (next >= end) return;
            TargetEntry run;
            run.camera = camera, run.index = uint32_t(next), run.last = uint32_t(end - 1);
            runs.push_back(std::move(run));
        };
        for (const auto& entry : journal.targets) {
            if (entry.camera != camera) continue;
            add_run_to(std::min(entry.index, count));
            next = std::max(next, uint64_t(entry.last) + 1);
        }
        add_run_to(count);
    }
    return runs;
}

}  // namespace ols
