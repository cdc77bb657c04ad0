// SPDX-License-Identifier: MIT
// Images by pread, from any thread.
#include "recordings/cine_file.hpp"

#include <fmt/format.h>

#include <cstring>

#include "exceptions.hpp"
#include "recordings/cine_header.hpp"
#include "recordings/cine_linear.hpp"
#include "recordings/shared_file.hpp"

namespace ols {

namespace {

class CineFile : public RecordedFrames {
  public:
    CineFile(SharedFile file, CineHeader header) : file_(std::move(file)), header_(std::move(header)) {}

    const RecordingFacts& facts() const override { return header_.facts; }

    Result<Frame> read(uint64_t index) const override {
        const RecordingFacts& facts = header_.facts;
        const auto damaged = [&](const std::string& why) {
            return fail(fmt::format("frame {} of '{}' cannot be read ({}): copy it again from the camera",
                                    facts.numbers[index], file_.path(), why));
        };
        // An annotation: its size, text, the size of the image; then the image.
        const uint64_t at = header_.offsets[index];
        uint32_t annotation = 0, size = 0;
        if (!file_.read(at, std::as_writable_bytes(std::span(&annotation, 1))))
            return damaged("the file ends before it");
        if (annotation < 8 || !file_.read(at + annotation - 4, std::as_writable_bytes(std::span(&size, 1))))
            return damaged(fmt::format("its annotation says it has {} bytes", annotation));
        if (size != header_.image_bytes())
            return damaged(fmt::format("it says it has {} bytes, not {}", size, header_.image_bytes()));
        std::vector<std::byte> packed(size);
        if (!file_.read(at + annotation, packed)) return damaged("the file ends within it");
        return unpack(packed);
    }

  private:
    Result<Frame> unpack(std::span<const std::byte> packed) const {
        const RecordingFacts& facts = header_.facts;
        const size_t row = size_t(facts.width) * size_t(header_.colors);
        std::vector<uint16_t> samples(row * facts.height);
        const Status unpacked = unpack_samples(packed, header_.layout, row, facts.height, header_.row_bytes, samples);
        if (!unpacked.ok()) return unpacked.error();
        if (header_.is_linearised)
            for (uint16_t& sample : samples) sample = cine_linear[sample];
        Frame frame;
        frame.width = facts.width, frame.height = facts.height;
        frame.cfa = *facts.cfa;
        frame.pitch_bytes = uint32_t(row * sizeof(uint16_t));
        if (facts.black) frame.black = float(*facts.black);
        if (facts.white) frame.white = float(*facts.white);
        frame.samples.resize(samples.size() * sizeof(uint16_t));
        for (size_t y = 0; y < facts.height; ++y) {
            uint16_t* from = samples.data() + (header_.is_bottom_up ? facts.height - 1 - y : y) * row;
            if (header_.colors == 3)
                for (size_t x = 0; x < row; x += 3) std::swap(from[x], from[x + 2]);
            std::memcpy(frame.samples.data() + y * frame.pitch_bytes, from, frame.pitch_bytes);
        }
        return frame;
    }

    const SharedFile file_;
    const CineHeader header_;
};

}  // namespace

Result<Recording> open_cine(const std::string& path) {
    return guarded("cannot read '" + path + "'", [&]() -> Result<Recording> {
        auto file = SharedFile::open(path);
        if (!file.ok()) return file.error();
        const ReadBytes read = [&](uint64_t offset, std::span<std::byte> to) { return file->read(offset, to); };
        auto header = read_cine_header(read, file->size(), path);
        if (!header.ok()) return header.error();
        return Recording(std::make_unique<CineFile>(std::move(*file), std::move(*header)));
    });
}

bool is_cine(const std::string& path) {
    const auto file = SharedFile::open(path);
    char start[2] = {};
    return file.ok() && file->read(0, std::as_writable_bytes(std::span(start))) && start[0] == 'C' && start[1] == 'I';
}

}  // namespace ols
