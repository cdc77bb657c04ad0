// SPDX-License-Identifier: MIT
// .cine files written here by the format's description, read back: by us, and by libavformat where it reads them.
// links: ols_recordings PkgConfig::LIBAV
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <random>

#include "recordings/cine_file.hpp"
#include "scratch_folder.hpp"

using namespace ols;

namespace {

constexpr int setup_bytes = 6900;

struct Cine {
    int width = 16, height = 8, images = 4;
    int bits = 16, real_bits = 12;  // bits a pixel in the file; of a sample
    uint32_t packing = 0, coding = 2, cfa = 4;
    int32_t first = -2, black = 64, white = 4000;
    bool has_times = true;
    std::vector<uint16_t> samples;  // of all images, top row first; colours red, green, blue

    int colors() const { return bits == 24 || bits == 48 ? 3 : 1; }
    void fill(unsigned seed) {
        std::mt19937 random(seed);
        samples.resize(size_t(images) * width * height * colors());
        for (auto& sample : samples) sample = uint16_t(random() & ((1u << real_bits) - 1));
    }
    const uint16_t* row(int image, int y) const {
        return samples.data() + (size_t(image) * height + y) * width * colors();
    }
};

template <typename T>
void put(std::string& bytes, T value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}
template <typename T>
void set(std::string& bytes, size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

std::string image_of(const Cine& cine, int image) {
    std::string bytes;
    const int row = cine.width * cine.colors();
    if (cine.packing != 0) {
        const int width = cine.packing == 256 ? 10 : 12;
        uint64_t held = 0;
        int count = 0;
        for (int y = 0; y < cine.height; ++y)
            for (int x = 0; x < row; ++x) {
                held = held << width | cine.row(image, y)[x];
                for (count += width; count >= 8; count -= 8) bytes.push_back(char(held >> (count - 8)));
            }
        return bytes;
    }
    for (int y = cine.height - 1; y >= 0; --y) {
        for (int x = 0; x < row; ++x) {
            const int from = cine.colors() == 3 ? x / 3 * 3 + 2 - x % 3 : x;  // blue first
            if (cine.bits == 8 || cine.bits == 24)
                bytes.push_back(char(cine.row(image, y)[from]));
            else
                put<uint16_t>(bytes, cine.row(image, y)[from]);
        }
    }
    return bytes;
}

uint64_t time_of(int image) {
    return 1'700'000'000'000'000'000u + uint64_t(image) * 462'963;
}

std::string bytes_of(const Cine& cine) {
    std::string setup(setup_bytes, '\0');
    set<uint16_t>(setup, 140, 0x5453), set<uint16_t>(setup, 142, setup_bytes);
    set<uint32_t>(setup, 743, 777), set<uint32_t>(setup, 768, 2160), set<uint32_t>(setup, 792, 2012);
    set<uint32_t>(setup, 808, cine.cfa), set<uint32_t>(setup, 896, uint32_t(cine.real_bits));
    set<int32_t>(setup, 5732, cine.black), set<int32_t>(setup, 5736, cine.white);
    std::string blocks;
    if (cine.has_times) {
        put<uint32_t>(blocks, 8 + 6), put<uint16_t>(blocks, 1007), put<uint16_t>(blocks, 0),
            blocks.append(6, 'x');  // of no use here
        put<uint32_t>(blocks, uint32_t(8 + 8 * cine.images)), put<uint16_t>(blocks, 1002), put<uint16_t>(blocks, 0);
        for (int i = 0; i < cine.images; ++i) {
            put<uint32_t>(blocks, uint32_t(((time_of(i) % 1'000'000'000) << 32) / 1'000'000'000) | 3);
            put<uint32_t>(blocks, uint32_t(time_of(i) / 1'000'000'000));
        }
    }
    const uint32_t offsets_at = uint32_t(84 + setup.size() + blocks.size());
    std::string file, images, offsets;
    put<uint16_t>(file, 0x4943), put<uint16_t>(file, 44), put<uint16_t>(file, uint16_t(cine.coding)),
        put<uint16_t>(file, 1);
    put<int32_t>(file, cine.first), put<uint32_t>(file, 99), put<int32_t>(file, cine.first),
        put<uint32_t>(file, uint32_t(cine.images));
    put<uint32_t>(file, 44), put<uint32_t>(file, 84), put<uint32_t>(file, offsets_at), put<uint64_t>(file, 0);
    put<uint32_t>(file, 40), put<int32_t>(file, cine.width), put<int32_t>(file, cine.height), put<uint16_t>(file, 1);
    put<uint16_t>(file, uint16_t(cine.bits)), put<uint32_t>(file, cine.packing);
    put<uint32_t>(file, uint32_t(image_of(cine, 0).size())), file.append(16, '\0');
    for (int i = 0; i < cine.images; ++i) {
        put<uint64_t>(offsets, offsets_at + 8 * uint64_t(cine.images) + images.size());
        const std::string image = image_of(cine, i), note(size_t(i), 'n');
        put<uint32_t>(images, uint32_t(8 + note.size())), images += note, put<uint32_t>(images, uint32_t(image.size())),
            images += image;
    }
    return file + setup + blocks + offsets + images;
}

class CineFiles : public ScratchFolder {
  protected:
    std::string write(const std::string& bytes) { return ScratchFolder::write("take.cine", bytes); }
    void expect_samples(
        const Cine& cine, const std::function<uint16_t(uint16_t)>& to_count = [](uint16_t s) { return s; }) {
        const auto file = open_cine(write(bytes_of(cine)));
        ASSERT_TRUE(file.ok()) << file.error().message;
        ASSERT_EQ((*file)->facts().frames(), uint64_t(cine.images));
        for (int i = 0; i < cine.images; ++i) {
            const auto frame = (*file)->read(uint64_t(i));
            ASSERT_TRUE(frame.ok()) << frame.error().message;
            for (int y = 0; y < cine.height; ++y) {
                const auto* row =
                    reinterpret_cast<const uint16_t*>(frame->samples.data() + size_t(y) * frame->pitch_bytes);
                for (int x = 0; x < cine.width * cine.colors(); ++x)
                    ASSERT_EQ(row[x], to_count(cine.row(i, y)[x])) << i << " " << y << " " << x;
            }
        }
    }
    std::string refusal(const std::string& bytes) {
        const auto file = open_cine(write(bytes));
        if (!file.ok()) return file.error().message;
        for (uint64_t i = 0; i < (*file)->facts().frames(); ++i)
            if (const auto frame = (*file)->read(i); !frame.ok()) return frame.error().message;
        return "";
    }
};

TEST_F(CineFiles, samples_of_every_packing_come_back) {
    for (const auto& [bits, real_bits, packing] : {std::tuple{8, 8, 0u}, {16, 12, 0u}, {16, 14, 0u}, {16, 12, 1024u}}) {
        Cine cine;
        cine.bits = bits, cine.real_bits = real_bits, cine.packing = packing;
        cine.white = (1 << real_bits) - 1;
        cine.fill(1);
        expect_samples(cine);
    }
    for (const int bits : {24, 48}) {
        Cine cine;
        cine.bits = bits, cine.real_bits = bits == 24 ? 8 : 12, cine.coding = 0;
        cine.white = (1 << cine.real_bits) - 1;
        cine.fill(2);
        expect_samples(cine);
    }
}

// The curve of the format: every code is above the one before it, 64 of 4095 is black and 4064 white, codes of light are spread as by a
// power: small steps in the dark, no more than 9 counts anywhere.
TEST_F(CineFiles, packed_ten_bits_become_linear_counts) {
    Cine cine;
    cine.packing = 256, cine.real_bits = 10, cine.width = 64, cine.height = 16, cine.images = 1;
    cine.samples.resize(1024);
    for (size_t i = 0; i < 1024; ++i) cine.samples[i] = uint16_t(i);
    const auto file = open_cine(write(bytes_of(cine)));
    ASSERT_TRUE(file.ok()) << file.error().message;
    EXPECT_EQ((*file)->facts().black, 64);
    EXPECT_EQ((*file)->facts().white, 4064);
    const auto frame = (*file)->read(0);
    const auto* counts = reinterpret_cast<const uint16_t*>(frame->samples.data());
    for (int code = 1; code < 1015; ++code) {
        EXPECT_GE(counts[code], counts[code - 1]) << code;
        EXPECT_LE(counts[code] - counts[code - 1], 9) << code;
    }
    // Anchors of the table that the description prints.
    for (const auto& [code, count] :
         {std::pair{0, 2}, {1, 5}, {64, 64}, {160, 156}, {512, 998}, {768, 2267}, {1014, 4064}, {1015, 4095}})
        EXPECT_EQ(counts[code], count) << code;
}

TEST_F(CineFiles, numbers_times_and_levels_are_the_cameras) {
    Cine cine;
    cine.fill(3);
    const auto file = open_cine(write(bytes_of(cine)));
    ASSERT_TRUE(file.ok()) << file.error().message;
    const RecordingFacts& facts = (*file)->facts();
    EXPECT_EQ(facts.numbers, (std::vector<int64_t>{-2, -1, 0, 1}));
    ASSERT_TRUE(facts.has_times);
    for (int i = 0; i < 4; ++i)
        EXPECT_NEAR(double(facts.times_ns[size_t(i)]) - double(time_of(i)), 0, 256);  // doubles of 2^60
    EXPECT_NEAR(double(facts.times_ns[3] - facts.times_ns[0]), 3 * 462'963, 2);
    EXPECT_EQ(facts.black, 64);
    EXPECT_EQ(facts.white, 4000);
    EXPECT_EQ(facts.cfa, Cfa::rggb);
    EXPECT_EQ(facts.name, "Phantom 2012 number 777");
}

// Decoded by libavformat and libavcodec: the top row first, as it is displayed.
std::vector<std::vector<uint8_t>> by_libavformat(const std::string& path, int rows, int row_bytes,
                                                 AVPixelFormat& format) {
    std::vector<std::vector<uint8_t>> images;
    AVFormatContext* input = nullptr;
    if (avformat_open_input(&input, path.c_str(), nullptr, nullptr) < 0) return images;
    const AVCodecParameters* parameters = input->streams[0]->codecpar;
    AVCodecContext* decoder = avcodec_alloc_context3(avcodec_find_decoder(parameters->codec_id));
    avcodec_parameters_to_context(decoder, parameters);
    avcodec_open2(decoder, nullptr, nullptr);
    AVPacket* packet = av_packet_alloc();
    AVFrame* frame = av_frame_alloc();
    while (av_read_frame(input, packet) >= 0) {
        if (avcodec_send_packet(decoder, packet) >= 0 && avcodec_receive_frame(decoder, frame) >= 0) {
            format = AVPixelFormat(frame->format);
            images.emplace_back();
            for (int y = 0; y < rows; ++y)
                images.back().insert(images.back().end(), frame->data[0] + y * frame->linesize[0],
                                     frame->data[0] + y * frame->linesize[0] + row_bytes);
        }
        av_packet_unref(packet);
    }
    av_frame_free(&frame);
    av_packet_free(&packet);
    avcodec_free_context(&decoder);
    avformat_close_input(&input);
    return images;
}

TEST_F(CineFiles, libavformat_sees_the_same_samples_and_filters_where_it_reads_them) {
    for (const auto& [cfa, ours, theirs] :
         {std::tuple{3u, Cfa::gbrg, AV_PIX_FMT_BAYER_GBRG16LE}, {4u, Cfa::rggb, AV_PIX_FMT_BAYER_RGGB16LE}}) {
        Cine cine;
        cine.cfa = cfa;
        cine.real_bits = 16, cine.white = 65535;  // of fewer bits libavcodec scales up
        cine.fill(4);
        const std::string path = write(bytes_of(cine));
        const auto file = open_cine(path);
        ASSERT_TRUE(file.ok()) << file.error().message;
        EXPECT_EQ((*file)->facts().cfa, ours);
        AVPixelFormat format = AV_PIX_FMT_NONE;
        const auto images = by_libavformat(path, cine.height, cine.width * 2, format);
        ASSERT_EQ(images.size(), size_t(cine.images));
        EXPECT_EQ(format, theirs);
        for (int i = 0; i < cine.images; ++i) {
            const auto frame = (*file)->read(uint64_t(i));
            ASSERT_TRUE(frame.ok());
            ASSERT_EQ(frame->samples.size(), images[size_t(i)].size());
            EXPECT_EQ(std::memcmp(frame->samples.data(), images[size_t(i)].data(), frame->samples.size()), 0) << i;
        }
    }
}

TEST_F(CineFiles, damage_and_unknown_kinds_are_refused_by_name) {
    Cine cine;
    cine.fill(5);
    const std::string whole = bytes_of(cine);
    EXPECT_EQ(refusal(whole), "");
    const auto changed = [&](size_t at, auto value) {
        std::string bytes = whole;
        set(bytes, at, value);
        return refusal(bytes);
    };
    const size_t setup = 84, blocks = setup + setup_bytes, times = blocks + 14, offsets = times + 8 + 32,
                 image = offsets + 32;
    for (const auto& [text, said] : {
             std::pair{refusal(whole.substr(0, 30)), "header"},
             {refusal(whole.substr(0, setup + 1000)), "beyond its end"},
             {refusal(whole.substr(0, image + 100)), "cut short"},
             {refusal(whole.substr(0, whole.size() - 1)), "ends within it"},
             {refusal("no cine at all, but long enough for the header of one"), "is no .cine"},
             {changed(6, uint16_t(2)), "version 2"},
             {changed(4, uint16_t(1)), "JPEG"},
             {changed(4, uint16_t(9)), "unknown way"},
             {changed(20, uint32_t(0)), "no image"},
             {changed(20, uint32_t(4'000'000'000)), "cut short"},
             {changed(28, uint32_t(4'000'000'000)), "beyond its end"},
             {changed(32, uint32_t(4'000'000'000)), "beyond its end"},
             {changed(48, int32_t(2'000'000'000)), "its images are"},
             {changed(52, int32_t(0)), "its images are"},
             {changed(58, uint16_t(7)), "7 bits a pixel"},
             {changed(60, uint32_t(3)), "packed in an unknown way"},
             {changed(64, uint32_t(12)), "say they have 12 bytes"},
             {changed(setup + 140, uint16_t(0)), "no mark"},
             {changed(setup + 142, uint16_t(200)), "before 2002"},
             {changed(setup + 808, uint32_t(0x80000002)), "several heads"},
             {changed(setup + 896, uint32_t(99)), "99 bits in 16"},
             {changed(setup + 5732, int32_t(5000)), "black level is 5000"},
             {changed(times, uint32_t(3)), "a block of 3 bytes"},
             {changed(times, uint32_t(0xffffffff)), "a block of"},
             {changed(times + 8 - 8 + 4, uint16_t(1003)), "type 1003"},
             {changed(offsets + 8, uint64_t(1) << 60), "image 1 of 4"},
             {changed(image, uint32_t(0)), "annotation"},
             {changed(image, uint32_t(0xffffffff)), "annotation"},
             {changed(image + 4, uint32_t(99)), "99 bytes"},
         })
        EXPECT_NE(text.find(said), std::string::npos) << "'" << text << "' for " << said;
}

}  // namespace
