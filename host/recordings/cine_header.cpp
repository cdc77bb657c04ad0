// SPDX-License-Identifier: MIT
// Little-endian fields at the offsets of the format's packed structures.
#include "recordings/cine_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "recordings/cine_linear.hpp"

namespace ols {

namespace {

// Offsets of fields; of SETUP those of software version 693 (2010) and later, which only grew at its end.
enum CineField : size_t {
    cine_header_size = 2,
    cine_compression = 4,
    cine_version = 6,
    cine_first_movie_image = 8,
    cine_total_images = 12,
    cine_first_image = 16,
    cine_images = 20,
    cine_off_bitmap = 24,
    cine_off_setup = 28,
    cine_off_offsets = 32,
    cine_trigger_time = 36,
    cine_bytes = 44,
};
enum BitmapField : size_t {
    bitmap_width = 4,
    bitmap_height = 8,
    bitmap_bits = 14,
    bitmap_compression = 16,
    bitmap_image_bytes = 20,
    bitmap_bytes = 40
};
enum SetupField : size_t {
    setup_mark = 140,
    setup_length = 142,
    setup_serial = 743,
    setup_flip_h = 756,
    setup_flip_v = 760,
    setup_frame_rate = 768,
    setup_camera_version = 792,
    setup_cfa = 808,
    setup_rotate = 884,
    setup_real_bits = 896,
    setup_least_bytes = 900,
    setup_black = 5732,
    setup_white = 5736,
    setup_levels_end = 5740,
    setup_crop = 6868,
    setup_crop_end = 6872,
};
constexpr uint32_t compression_rgb = 0, compression_jpeg = 1, compression_raw = 2;  // CC_RGB, CC_LEAD, CC_UNINT
constexpr uint32_t bitmap_plain = 0, bitmap_packed_10 = 256, bitmap_packed_12 = 1024;
constexpr uint16_t block_times = 1002, block_exposures = 1003;

template <typename T>
T field(std::span<const std::byte> bytes, size_t offset) {
    T value;  // this machine is little-endian, as the wire format asks
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
}

class HeaderReader {
  public:
    HeaderReader(const ReadBytes& read, uint64_t size, const std::string& path)
        : read_(read), size_(size), path_(path) {}

    Result<CineHeader> read() {
        for (const auto step : {&HeaderReader::read_file_header, &HeaderReader::read_bitmap, &HeaderReader::read_setup,
                                &HeaderReader::read_offsets, &HeaderReader::read_blocks})
            if (const Status done = (this->*step)(); !done.ok()) return done.error();
        return std::move(header_);
    }

  private:
    Error damaged(const std::string& why) const {
        return fail(fmt::format("'{}' is damaged ({}): copy it again from the camera", path_, why));
    }
    Error not_read(const std::string& what) const { return fail(fmt::format("'{}' {}", path_, what)); }

    Result<std::vector<std::byte>> bytes(uint64_t offset, uint64_t count, const char* what) const {
        std::vector<std::byte> bytes;
        if (offset <= size_ && count <= size_ - offset) {
            bytes.resize(count);
            if (read_(offset, bytes)) return bytes;
        }
        return damaged(fmt::format("its {} at byte {} lies beyond its end, {}", what, offset, size_));
    }

    Status read_file_header() {
        const auto start = bytes(0, cine_bytes, "header");
        if (!start.ok()) return start.error();
        if (field<uint16_t>(*start, 0) != 0x4943 || field<uint16_t>(*start, cine_header_size) < cine_bytes)
            return not_read("is no .cine file: it does not begin with the header of one");
        compression_ = field<uint16_t>(*start, cine_compression);
        if (const auto version = field<uint16_t>(*start, cine_version); version != 1)
            return not_read(
                fmt::format("is of version {} of the format, not 1: save it anew with the camera's software", version));
        if (compression_ == compression_jpeg)
            return not_read("holds JPEG pictures, which have lost light: save it as raw cine");
        if (compression_ > compression_raw)
            return not_read(fmt::format("is coded in an unknown way ({})", compression_));
        images_ = field<uint32_t>(*start, cine_images);
        first_image_ = field<int32_t>(*start, cine_first_image);
        off_bitmap_ = field<uint32_t>(*start, cine_off_bitmap);
        off_setup_ = field<uint32_t>(*start, cine_off_setup);
        off_offsets_ = field<uint32_t>(*start, cine_off_offsets);
        if (images_ == 0) return not_read("holds no image");
        auto& detail = header_.facts.detail;
        detail["trigger_time_ns"] = time_ns(*start, cine_trigger_time);
        detail["first_frame_in_camera"] = field<int32_t>(*start, cine_first_movie_image);
        detail["frames_in_camera"] = field<uint32_t>(*start, cine_total_images);
        return Done{};
    }

    // TIME64: 32.32 seconds, whose two lowest bits are flags of IRIG and of the event input.
    static uint64_t time_ns(std::span<const std::byte> bytes, size_t offset) {
        const uint64_t fraction = field<uint32_t>(bytes, offset) & ~3u, seconds = field<uint32_t>(bytes, offset + 4);
        return seconds * 1'000'000'000 + ((fraction * 1'000'000'000) >> 32);
    }

    Status read_bitmap() {
        const auto bitmap = bytes(off_bitmap_, bitmap_bytes, "image header");
        if (!bitmap.ok()) return bitmap.error();
        const int64_t width = field<int32_t>(*bitmap, bitmap_width), height = field<int32_t>(*bitmap, bitmap_height);
        if (width < 8 || std::abs(height) < 8 || width > 65535 || std::abs(height) > 65535)
            return damaged(fmt::format("its images are {} x {}", width, height));
        header_.facts.width = uint32_t(width);
        header_.facts.height = uint32_t(std::abs(height));
        bits_ = field<uint16_t>(*bitmap, bitmap_bits);
        bitmap_compression_ = field<uint32_t>(*bitmap, bitmap_compression);
        image_bytes_ = field<uint32_t>(*bitmap, bitmap_image_bytes);
        // As a Windows bitmap; packed ones lie top to bottom.
        header_.is_bottom_up = bitmap_compression_ == bitmap_plain && height > 0;
        return Done{};
    }

    Status read_setup() {
        const auto mark = bytes(off_setup_, setup_length + 2, "set-up");
        if (!mark.ok()) return mark.error();
        setup_bytes_ = field<uint16_t>(*mark, setup_length);
        if (field<uint16_t>(*mark, setup_mark) != 0x5453) return damaged("its set-up has no mark 'ST'");
        if (setup_bytes_ < setup_least_bytes)
            return not_read(fmt::format(
                "has a set-up of {} bytes, of software before 2002: save it anew with a newer one", setup_bytes_));
        const auto setup = bytes(off_setup_, setup_bytes_, "set-up");
        if (!setup.ok()) return setup.error();
        RecordingFacts& facts = header_.facts;
        facts.name = fmt::format("Phantom {} number {}", field<uint32_t>(*setup, setup_camera_version),
                                 field<uint32_t>(*setup, setup_serial));
        if (const auto rate = field<uint32_t>(*setup, setup_frame_rate); rate > 0) facts.frame_rate_hz = rate;
        if (field<uint32_t>(*setup, setup_flip_h) || field<uint32_t>(*setup, setup_flip_v) ||
            field<int32_t>(*setup, setup_rotate))
            facts.said.push_back("its viewer's flip or rotation is left out: samples lie as on the sensor");
        if (setup_bytes_ >= setup_crop_end && field<uint32_t>(*setup, setup_crop))
            facts.said.push_back("its viewer's crop is left out: the whole image is taken");
        if (const Status known = choose_colors(field<uint32_t>(*setup, setup_cfa)); !known.ok()) return known;
        if (const Status known = choose_layout(field<uint32_t>(*setup, setup_real_bits)); !known.ok()) return known;
        return read_levels(*setup);
    }

    Status choose_colors(uint32_t code) {
        header_.colors = bits_ == 24 || bits_ == 48 ? 3 : 1;
        header_.facts.cfa = header_.colors == 3 ? Cfa::rgb : Cfa::none;
        if (compression_ == compression_rgb) return Done{};
        if (header_.colors == 3) return damaged("it is raw and has colours");
        // Of an image with its top row first: CFA_NONE, CFA_BAYER gb/rg, _BAYERFLIP rg/gb, _BAYERFLIPB gr/bg, _BAYERFLIPH bg/gr.
        switch (code) {
            case 0: return Done{};
            case 3: header_.facts.cfa = Cfa::gbrg; return Done{};
            case 4: header_.facts.cfa = Cfa::rggb; return Done{};
            case 5: header_.facts.cfa = Cfa::grbg; return Done{};
            case 6: header_.facts.cfa = Cfa::bggr; return Done{};
            default:
                return not_read(fmt::format(
                    "has colour filters of code {:#x} (cameras of several heads, or unknown), which are not "
                    "read: export TIFF or DNG, and ingest these",
                    code));
        }
    }

    Status choose_layout(uint32_t real_bits) {
        SampleLayout& layout = header_.layout;
        RecordingFacts& facts = header_.facts;
        const uint64_t samples = uint64_t(facts.width) * uint64_t(header_.colors);
        layout.cfa = *facts.cfa;
        const bool is_packed = bitmap_compression_ == bitmap_packed_10 || bitmap_compression_ == bitmap_packed_12;
        if (is_packed) {
            layout = {SamplePacking::bits_high, bitmap_compression_ == bitmap_packed_10 ? 10 : 12, *facts.cfa};
            header_.is_linearised = layout.bits == 10;
            if (header_.colors != 1 || samples * uint64_t(layout.bits) % 8 != 0)
                return damaged(fmt::format("{} samples of {} bits a row fill no whole bytes", samples, layout.bits));
        } else if (bitmap_compression_ != bitmap_plain) {
            return not_read(fmt::format("has images packed in an unknown way ({})", bitmap_compression_));
        } else if (bits_ == 8 || bits_ == 24) {
            layout.packing = SamplePacking::bytes, layout.bits = 8;
        } else if (bits_ == 16 || bits_ == 48) {
            if (real_bits < 8 || real_bits > 16)
                return damaged(fmt::format("its samples have {} bits in 16", real_bits));
            layout.packing = SamplePacking::words, layout.bits = int(std::max(real_bits, 9u));
        } else {
            return not_read(fmt::format("has {} bits a pixel: 8, 16, 24, 48 and packed 10 and 12 are read", bits_));
        }
        // Rows of plain images may be filled up to whole words of four bytes, as a Windows bitmap's.
        header_.row_bytes = packed_row_bytes(layout, samples);
        const uint64_t filled = (header_.row_bytes + 3) / 4 * 4;
        if (!is_packed && image_bytes_ == filled * facts.height) header_.row_bytes = filled;
        if (image_bytes_ != 0 && image_bytes_ != header_.image_bytes())
            return damaged(fmt::format("its images say they have {} bytes, and {} x {} of {} bits are {}", image_bytes_,
                                       facts.width, facts.height, layout.bits, header_.image_bytes()));
        facts.link = fmt::format("Phantom .cine, {} bits{}", layout.bits, is_packed ? " packed" : "");
        facts.detail["bits"] = layout.bits;
        return Done{};
    }

    Status read_levels(std::span<const std::byte> setup) {
        RecordingFacts& facts = header_.facts;
        if (header_.is_linearised) {
            facts.black = cine_linear_black, facts.white = cine_linear_white;
            facts.said.push_back("its 10 bits are made linear counts of 12 by the format's table");
            return Done{};
        }
        if (setup.size() < setup_levels_end) return Done{};
        const int64_t black = field<int32_t>(setup, setup_black), white = field<int32_t>(setup, setup_white);
        if (black == 0 && white == 0) return Done{};
        if (black < 0 || white <= black || white > 65535)
            return damaged(fmt::format("its black level is {} and its white level {}", black, white));
        facts.black = double(black), facts.white = double(white);
        return Done{};
    }

    Status read_offsets() {
        RecordingFacts& facts = header_.facts;
        if (header_.image_bytes() > size_ || images_ > size_ / header_.image_bytes())
            return damaged(fmt::format(
                "it says it holds {} images of {} bytes, and it has {} bytes: it was cut short, or not copied "
                "to its end",
                images_, header_.image_bytes(), size_));
        const auto table = bytes(off_offsets_, 8 * uint64_t(images_), "table of images");
        if (!table.ok()) return table.error();
        for (uint64_t i = 0; i < images_; ++i) {
            const uint64_t offset = field<uint64_t>(*table, 8 * i);
            if (offset < cine_bytes || offset > size_ || size_ - offset < header_.image_bytes() + 8)
                return damaged(
                    fmt::format("image {} of {} at byte {} lies outside of its {} bytes, or it was cut short", i,
                                images_, offset, size_));
            header_.offsets.push_back(offset);
            facts.numbers.push_back(first_image_ + int64_t(i));
        }
        facts.detail["first_frame"] = facts.numbers.front();
        facts.detail["last_frame"] = facts.numbers.back();
        return Done{};
    }

    // Between set-up and offsets: size, type, reserved, then the block's items.
    Status read_blocks() {
        const uint64_t end = off_offsets_;
        for (uint64_t at = uint64_t(off_setup_) + setup_bytes_; at + 8 <= end;) {
            const auto head = bytes(at, 8, "block");
            if (!head.ok()) return head.error();
            const uint64_t size = field<uint32_t>(*head, 0);
            if (size < 8 || size > end - at) return damaged(fmt::format("a block of {} bytes at byte {}", size, at));
            const auto type = field<uint16_t>(*head, 4);
            if (type == block_times || type == block_exposures)
                if (const Status done = read_block(type, at + 8, size - 8); !done.ok()) return done;
            at += size;
        }
        if (!header_.facts.has_times)
            header_.facts.said.push_back("it holds no times of its frames: they are taken to be a period apart");
        return Done{};
    }

    Status read_block(uint16_t type, uint64_t at, uint64_t size) {
        const uint64_t item = type == block_times ? 8 : 4;
        if (size != item * images_)
            return damaged(fmt::format("a block of type {} has {} bytes for {} images", type, size, images_));
        const auto items = bytes(at, size, "block");
        if (!items.ok()) return items.error();
        RecordingFacts& facts = header_.facts;
        if (type == block_times) {
            facts.has_times = true;
            facts.times_ns.clear();
            for (uint64_t i = 0; i < images_; ++i) facts.times_ns.push_back(time_ns(*items, 8 * i));
            return Done{};
        }
        uint32_t least = UINT32_MAX, most = 0;
        for (uint64_t i = 0; i < images_; ++i) {
            const auto exposure = field<uint32_t>(*items, 4 * i);
            least = std::min(least, exposure), most = std::max(most, exposure);
        }
        facts.detail["exposure_us"] = {double(least) * 1e6 / 4294967296.0, double(most) * 1e6 / 4294967296.0};
        return Done{};
    }

    const ReadBytes& read_;
    const uint64_t size_;
    const std::string& path_;
    CineHeader header_;
    uint32_t compression_ = 0, images_ = 0, off_bitmap_ = 0, off_setup_ = 0, off_offsets_ = 0, bits_ = 0,
             bitmap_compression_ = 0;
    uint32_t setup_bytes_ = 0, image_bytes_ = 0;
    int32_t first_image_ = 0;
};

}  // namespace

Result<CineHeader> read_cine_header(const ReadBytes& read, uint64_t size, const std::string& path) {
    return HeaderReader(read, size, path).read();
}

}  // namespace ols
