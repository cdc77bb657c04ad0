// SPDX-License-Identifier: MIT
// A frame a file: pictures by the readers of photographs, whose samples are taken as they are coded.
#include "recordings/numbered_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "exceptions.hpp"
#include "image/exr.hpp"
#include "image/sample_layout.hpp"
#include "photographs/picture_samples.hpp"
#include "photographs/raw_picture.hpp"
#include "recordings/file_series.hpp"
#include "recordings/shared_file.hpp"

namespace ols {

namespace {

// Half of what a count may be off by where codes were stretched to 16 bits and rounded.
constexpr double count_tolerance = 0.05;

struct NamedLayout {
    const char* name;
    SampleLayout layout;
};
constexpr NamedLayout named_layouts[] = {
    {"8", {SamplePacking::bytes, 8}},
    {"10", {SamplePacking::words, 10}},
    {"12", {SamplePacking::words, 12}},
    {"14", {SamplePacking::words, 14}},
    {"16", {SamplePacking::words, 16}},
    {"16be", {SamplePacking::words_big, 16}},
    {"10p", {SamplePacking::bits_low, 10}},
    {"12p", {SamplePacking::bits_low, 12}},
    {"12packed", {SamplePacking::gige_pairs, 12}},
    {"10msb", {SamplePacking::bits_high, 10}},
    {"12msb", {SamplePacking::bits_high, 12}},
    {"10mipi", {SamplePacking::mipi, 10}},
    {"12mipi", {SamplePacking::mipi, 12}},
};

struct RawLayout {
    uint32_t width = 0, height = 0;
    SampleLayout layout;

    uint64_t frame_bytes() const { return packed_row_bytes(layout, width) * uint64_t(height); }
};

Result<RawLayout> parse_raw(const std::string& text) {
    RawLayout raw;
    char name[16] = {}, rest = 0;
    if (std::sscanf(text.c_str(), "%5ux%5u:%15[0-9a-z]%c", &raw.width, &raw.height, name, &rest) == 3 &&
        raw.width >= 8 && raw.height >= 8 && raw.width <= 65535 && raw.height <= 65535)
        for (const NamedLayout& known : named_layouts)
            if (std::strcmp(known.name, name) == 0) {
                raw.layout = known.layout;
                return raw;
            }
    return fail(
        fmt::format("--raw {}: write WIDTHxHEIGHT:LAYOUT, as 640x480:12p; layouts are {}", text, raw_layout_names()));
}

// What all files of a recording have in common.
struct Kind {
    uint32_t width = 0, height = 0;
    PixelFormat format = PixelFormat::u16;
    std::optional<Cfa> cfa;  // where the file says
    std::optional<double> black, white;

    friend bool operator==(const Kind&, const Kind&) = default;
};

struct Decoded {
    Kind kind;
    std::vector<std::byte> samples;
    std::string container;
    std::vector<std::string> said;
};

std::string describe(const Kind& kind) {
    return fmt::format("{} x {}, {}, {}", kind.width, kind.height,
                       kind.cfa == Cfa::rgb ? "R G B"
                       : kind.cfa           ? "a mosaic or grey"
                                            : "grey",
                       kind.format == PixelFormat::u16 ? "whole counts" : "fractions of counts");
}

template <typename Sample>
std::vector<std::byte> bytes_of(const std::vector<Sample>& samples) {
    const auto bytes = std::as_bytes(std::span(samples));
    return {bytes.begin(), bytes.end()};
}

class PictureDecoder {
  public:
    explicit PictureDecoder(const NumberedOptions& options)
        : last_count_(std::exp2(options.bits) - 1), full_scale_(options.full_scale) {}

    // `floats`: whether pictures of floats keep them; not given: by whether all of this one's are whole.
    Result<Decoded> decode(const std::string& path, std::optional<bool> floats) const {
        const auto format = picture_format(path);
        if (!format.ok()) return format.error();
        switch (*format) {
            case PictureFormat::png:
            case PictureFormat::tiff:
            case PictureFormat::pnm: return decode_codes(path, *format);
            case PictureFormat::openexr: return decode_floats(path, floats);
            case PictureFormat::raw: return decode_raw(path);
            default:
                return fail(fmt::format(
                    "'{}' is a {} picture, in which samples are not what the sensor counted: a recording is PNG, "
                    "TIFF, PNM, OpenEXR or DNG",
                    path, format_name(*format)));
        }
    }

  private:
    Error no_count(const std::string& path, double value) const {
        return fail(fmt::format(
            "'{}' holds the value {:g}, which is no count of a camera that counts to {:.0f}{}: give --full-scale, the "
            "value of the largest count (65520 where 12 bits lie in the upper of 16), or correct bits in [[camera]]",
            path, value, last_count_, full_scale_ > 0 ? fmt::format(" at full scale {:g}", full_scale_) : ""));
    }

    Result<uint16_t> count_of(double value, const std::string& path) const {
        const double count = full_scale_ > 0 ? value * last_count_ / full_scale_ : value;
        const double whole = std::round(count);
        if (!(whole >= 0 && whole <= last_count_) || std::abs(count - whole) > count_tolerance)
            return no_count(path, value);
        return uint16_t(whole);
    }

    Result<Decoded> decode_codes(const std::string& path, PictureFormat format) const {
        auto read = read_samples(path, format, 0);
        if (!read.ok()) return read.error();
        if (read->orientation != 1)
            return fail(fmt::format("'{}' says it is turned (orientation {}): samples have to lie as on the sensor",
                                    path, read->orientation));
        if (read->channels != read->colors)
            return fail(fmt::format("'{}' has a channel beside its samples: a recording has none", path));
        Decoded decoded;
        decoded.container = format_name(format);
        decoded.kind = {uint32_t(read->width), uint32_t(read->height), PixelFormat::u16, {}, {}, {}};
        if (read->colors == 3) decoded.kind.cfa = Cfa::rgb;
        if (!read->label.name.empty())
            decoded.said.push_back(read->label.name +
                                   " is left out: samples of a recording are what the sensor counted");
        return std::visit(
            [&](const auto& codes) { return take_codes(codes, read->last_code, path, std::move(decoded)); },
            read->codes);
    }

    template <typename Code>
    Result<Decoded> take_codes(const std::vector<Code>& codes, double last_code, const std::string& path,
                               Decoded decoded) const {
        if constexpr (std::is_same_v<Code, float>) {
            return fail("'" + path + "' is of floats or of more than 16 bits: write 8 or 16 bits, or OpenEXR");
        } else {
            constexpr double last = double(std::numeric_limits<Code>::max());
            std::vector<int32_t> table(size_t(last) + 1, -1);  // by code, made as codes come
            std::vector<uint16_t> counts(codes.size());
            for (size_t i = 0; i < codes.size(); ++i) {
                int32_t& known = table[codes[i]];
                if (known < 0) {
                    // OpenImageIO stretches codes of fewer bits: back to the code itself, which is exact.
                    const auto count = count_of(std::round(codes[i] / last * last_code), path);
                    if (!count.ok()) return count.error();
                    known = *count;
                }
                counts[i] = uint16_t(known);
            }
            decoded.samples = bytes_of(counts);
            return decoded;
        }
    }

    Result<Decoded> decode_floats(const std::string& path, std::optional<bool> floats) const {
        const auto read = read_exr_picture(path, {.convert = false, .turn = false});
        if (!read.ok()) return read.error();
        const Image& pixels = read->pixels;
        if (pixels.channels != 1 && pixels.channels != 3)
            return fail(fmt::format("'{}' has {} channels: a recording has one, or R G B", path, pixels.channels));
        Decoded decoded;
        decoded.container = "OpenEXR";
        decoded.said = read->said;
        decoded.kind = {uint32_t(pixels.width), uint32_t(pixels.height), PixelFormat::u16, {}, {}, {}};
        if (pixels.channels == 3) decoded.kind.cfa = Cfa::rgb;
        std::vector<uint16_t> counts;
        for (const float value : pixels.data) {
            const auto count = count_of(value, path);
            if (!count.ok() && floats == false) return count.error();
            if (!count.ok() || floats == true) break;
            counts.push_back(*count);
        }
        if (counts.size() == pixels.data.size()) {
            decoded.samples = bytes_of(counts);
            return decoded;
        }
        decoded.kind.format = PixelFormat::f32;
        std::vector<float> values = pixels.data;
        if (full_scale_ > 0)
            for (float& value : values) value = float(double(value) * last_count_ / full_scale_);
        decoded.samples = bytes_of(values);
        return decoded;
    }

    Result<Decoded> decode_raw(const std::string& path) const {
        if (full_scale_ > 0)
            return fail("'" + path + "' is a camera's raw file, which knows its levels: leave out --full-scale");
        const auto read = read_raw_counts(path);
        if (!read.ok()) return read.error();
        Decoded decoded;
        decoded.container = "DNG or raw";
        decoded.kind = {
            uint32_t(read->width), uint32_t(read->height), PixelFormat::u16, read->cfa, read->black, read->white};
        if (!read->has_one_black)
            decoded.said.push_back("the black level is the mean of those of the mosaic's four places");
        decoded.samples = bytes_of(read->counts);
        return decoded;
    }

    const double last_count_, full_scale_;
};

Frame frame_of(const Kind& kind, const std::vector<std::byte>& samples) {
    Frame frame;
    frame.width = kind.width, frame.height = kind.height;
    frame.format = kind.format;
    frame.cfa = kind.cfa.value_or(Cfa::none);
    frame.pitch_bytes = uint32_t(samples.size() / kind.height);
    if (kind.black) frame.black = float(*kind.black);
    if (kind.white) frame.white = float(*kind.white);
    frame.samples.assign(samples.data(), samples.data() + samples.size());
    return frame;
}

RecordingFacts facts_of(const Kind& kind, const std::string& name) {
    RecordingFacts facts;
    facts.name = name;
    facts.width = kind.width, facts.height = kind.height;
    facts.cfa = kind.cfa;
    facts.black = kind.black, facts.white = kind.white;
    return facts;
}

class NumberedPictures : public RecordedFrames {
  public:
    NumberedPictures(FileSeries series, const NumberedOptions& options, const Decoded& first)
        : series_(std::move(series)), decoder_(options), kind_(first.kind), facts_(facts_of(kind_, series_.name)) {
        facts_.link = fmt::format("numbered files, {}", first.container);
        facts_.said = first.said;
        if (kind_.format == PixelFormat::f32) facts_.said.push_back("samples are fractions of counts and stay floats");
        if (series_.others > 0)
            facts_.said.push_back(fmt::format("{} files of the folder are not of the recording", series_.others));
        for (const NumberedFile& file : series_.files) facts_.numbers.push_back(file.number);
    }

    const RecordingFacts& facts() const override { return facts_; }

    Result<Frame> read(uint64_t index) const override {
        const std::string& path = series_.files[index].path;
        auto decoded = guarded("cannot read '" + path + "'",
                               [&] { return decoder_.decode(path, kind_.format == PixelFormat::f32); });
        if (!decoded.ok()) return decoded.error();
        if (decoded->kind != kind_)
            return fail(fmt::format("'{}' ({}) is not like '{}' ({})", path, describe(decoded->kind),
                                    series_.files.front().path, describe(kind_)));
        return frame_of(kind_, std::move(decoded->samples));
    }

  private:
    const FileSeries series_;
    const PictureDecoder decoder_;
    const Kind kind_;
    RecordingFacts facts_;
};

Kind kind_of(const RawLayout& raw) {
    return {raw.width, raw.height, PixelFormat::u16, {}, {}, {}};
}

Result<Frame> read_raw_frame(const SharedFile& file, uint64_t offset, const RawLayout& raw) {
    std::vector<std::byte> packed(raw.frame_bytes());
    if (!file.read(offset, packed)) return fail(fmt::format("'{}' ends within a frame: copy it again", file.path()));
    std::vector<uint16_t> samples(size_t(raw.width) * raw.height);
    const Status unpacked =
        unpack_samples(packed, raw.layout, raw.width, raw.height, packed_row_bytes(raw.layout, raw.width), samples);
    if (!unpacked.ok()) return unpacked.error();
    return frame_of(kind_of(raw), bytes_of(samples));
}

RecordingFacts facts_of(const RawLayout& raw, const std::string& name, const std::string& text) {
    RecordingFacts facts = facts_of(kind_of(raw), name);
    facts.link = "samples without a header, " + text;
    return facts;
}

// A file a frame.
class NumberedRaw : public RecordedFrames {
  public:
    NumberedRaw(FileSeries series, const RawLayout& raw, const std::string& text)
        : series_(std::move(series)), raw_(raw), facts_(facts_of(raw, series_.name, text)) {
        for (const NumberedFile& file : series_.files) facts_.numbers.push_back(file.number);
    }
    const RecordingFacts& facts() const override { return facts_; }
    Result<Frame> read(uint64_t index) const override {
        const auto file = SharedFile::open(series_.files[index].path);
        if (!file.ok()) return file.error();
        if (file->size() != raw_.frame_bytes())
            return fail(fmt::format("'{}' has {} bytes, and a frame of this layout {}: correct --raw, or copy it again",
                                    file->path(), file->size(), raw_.frame_bytes()));
        return read_raw_frame(*file, 0, raw_);
    }

  private:
    const FileSeries series_;
    const RawLayout raw_;
    RecordingFacts facts_;
};

// Frame behind frame in one file.
class RawStream : public RecordedFrames {
  public:
    RawStream(SharedFile file, const RawLayout& raw, const std::string& text)
        : file_(std::move(file)),
          raw_(raw),
          facts_(facts_of(raw, std::filesystem::path(file_.path()).filename().string(), text)) {
        for (uint64_t i = 0; i < file_.size() / raw_.frame_bytes(); ++i) facts_.numbers.push_back(int64_t(i));
    }
    const RecordingFacts& facts() const override { return facts_; }
    Result<Frame> read(uint64_t index) const override {
        return read_raw_frame(file_, index * raw_.frame_bytes(), raw_);
    }

  private:
    const SharedFile file_;
    const RawLayout raw_;
    RecordingFacts facts_;
};

Result<Recording> open_raw(const std::string& path, const std::string& text) {
    const auto raw = parse_raw(text);
    if (!raw.ok()) return raw.error();
    std::error_code error;
    if (std::filesystem::is_regular_file(path, error)) {
        auto file = SharedFile::open(path);
        if (!file.ok()) return file.error();
        if (file->size() == 0 || file->size() % raw->frame_bytes() != 0)
            return fail(fmt::format("'{}' has {} bytes, no whole number of frames of {} bytes: correct --raw", path,
                                    file->size(), raw->frame_bytes()));
        if (file->size() > raw->frame_bytes())
            return Recording(std::make_unique<RawStream>(std::move(*file), *raw, text));
    }
    auto series = find_series(path, true);
    if (!series.ok()) return series.error();
    Recording frames = std::make_unique<NumberedRaw>(std::move(*series), *raw, text);
    if (const auto first = frames->read(0); !first.ok()) return first.error();
    return frames;
}

}  // namespace

std::string raw_layout_names() {
    std::string names;
    for (const NamedLayout& known : named_layouts) names += (names.empty() ? "" : ", ") + std::string(known.name);
    return names;
}

Result<Recording> open_numbered(const std::string& path, const NumberedOptions& options) {
    if (!options.raw.empty()) return open_raw(path, options.raw);
    auto series = find_series(path, false);
    if (!series.ok()) return series.error();
    const std::string& first_path = series->files.front().path;
    const auto first = guarded("cannot read '" + first_path + "'",
                               [&] { return PictureDecoder(options).decode(first_path, std::nullopt); });
    if (!first.ok()) return first.error();
    return Recording(std::make_unique<NumberedPictures>(std::move(*series), options, *first));
}

}  // namespace ols
