// SPDX-License-Identifier: MIT
// Kind, range, and whether it is the stage's camera's.
#include "recordings/open_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "recordings/cine_file.hpp"

namespace ols {

namespace {

// Some of a recording's frames, of the camera's colours where the files do not say.
class ChosenFrames : public RecordedFrames {
  public:
    ChosenFrames(Recording all, uint64_t first, uint64_t count, Cfa cfa)
        : all_(std::move(all)), first_(first), facts_(all_->facts()), cfa_(cfa) {
        const auto cut = [&](auto& values) {
            if (values.empty()) return;
            values.erase(values.begin() + ptrdiff_t(first + count), values.end());
            values.erase(values.begin(), values.begin() + ptrdiff_t(first));
        };
        cut(facts_.numbers);
        cut(facts_.times_ns);
        facts_.cfa = cfa;
    }
    const RecordingFacts& facts() const override { return facts_; }
    Result<Frame> read(uint64_t index) const override {
        auto frame = all_->read(first_ + index);
        if (frame.ok()) frame->cfa = cfa_;
        return frame;
    }

  private:
    const Recording all_;
    const uint64_t first_;
    RecordingFacts facts_;
    const Cfa cfa_;
};

std::optional<int64_t> parse_end(const std::string& text, int64_t otherwise) {
    if (text.empty()) return otherwise;
    int64_t value = 0;
    const char* begin = text.data() + (text[0] == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

// Index of the first frame and how many.
Result<std::pair<uint64_t, uint64_t>> choose(const RecordingFacts& facts, const std::string& range) {
    const auto& numbers = facts.numbers;
    if (range.empty()) return std::pair(uint64_t(0), facts.frames());
    const size_t colon = range.find(':');
    const auto first = parse_end(range.substr(0, colon), numbers.front());
    const auto last = colon == std::string::npos ? std::nullopt : parse_end(range.substr(colon + 1), numbers.back());
    if (!first || !last) return fail("--range " + range + ": write FIRST:LAST, numbers of frames, as -2000:12000");
    const auto begin = std::ranges::lower_bound(numbers, *first), end = std::ranges::upper_bound(numbers, *last);
    if (begin >= end)
        return fail(
            fmt::format("--range {}: the recording's frames are {} to {}", range, numbers.front(), numbers.back()));
    return std::pair(uint64_t(begin - numbers.begin()), uint64_t(end - begin));
}

const char* name_of(Cfa cfa) {
    switch (cfa) {
        case Cfa::none: return "none";
        case Cfa::rggb: return "rggb";
        case Cfa::bggr: return "bggr";
        case Cfa::grbg: return "grbg";
        case Cfa::gbrg: return "gbrg";
        case Cfa::rgb: return "rgb";
    }
    return "";
}

Status check_camera(const std::string& path, const RecordingFacts& facts, const CameraConfig& camera) {
    std::string keys;
    const auto differ = [&](const std::string& key) { keys += (keys.empty() ? "" : ", ") + key; };
    if (int(facts.width) != camera.width) differ(fmt::format("width = {}", facts.width));
    if (int(facts.height) != camera.height) differ(fmt::format("height = {}", facts.height));
    if (facts.cfa && *facts.cfa != camera.cfa) differ(fmt::format("cfa = \"{}\"", name_of(*facts.cfa)));
    if (!facts.cfa && camera.cfa == Cfa::rgb) differ("cfa = \"none\", or that of its mosaic");
    if (keys.empty()) return Done{};
    return fail(fmt::format("'{}' is not of the stage's camera: its [[camera]] would have {}", path, keys));
}

}  // namespace

Result<Recording> open_recording(const std::string& path, const RecordingOptions& options, const CameraConfig& camera) {
    const bool cine = options.files.raw.empty() && is_cine(path);
    if (cine && options.files.full_scale > 0)
        return fail("'" + path + "' is a .cine, which knows its levels: leave out --full-scale");
    auto frames = cine ? open_cine(path) : open_numbered(path, options.files);
    if (!frames.ok()) return frames;
    const RecordingFacts& facts = (*frames)->facts();
    if (const Status fits = check_camera(path, facts, camera); !fits.ok()) return fits.error();
    const auto chosen = choose(facts, options.range);
    if (!chosen.ok()) return chosen.error();
    return Recording(std::make_unique<ChosenFrames>(std::move(*frames), chosen->first, chosen->second, camera.cfa));
}

}  // namespace ols
