// SPDX-License-Identifier: MIT
// Targets that OpenEXR itself wrote, wrong in one thing each, in an archive whose journal agrees with them: each is refused by
// name, by verify and by every reading.
// links: ols_archive z
#include "archive/target_header.hpp"

#include <ImfIntAttribute.h>
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <functional>

#include "take_fixture.hpp"
#include "target_files.hpp"

using namespace ols;
using namespace ols::test;

namespace {

Target full_target() {
    Target target = numbered_target(3, 70, 66, Cfa::rggb, 0);
    const size_t pixels = 70 * 66;
    target.noise_gain.assign(pixels, 1);
    target.confidence.assign(pixels, 1);
    target.matte = {4, {std::vector<float>(pixels, 0.5f)}, std::vector<float>(pixels, 0.1f)};
    target.motion = {{-0.01, 0.01}, {FlowField(70, 66), FlowField(70, 66)}};
    return target;
}

}  // namespace

class TargetHeaders : public TakeDirectory {
  protected:
    void SetUp() override {
        TakeDirectory::SetUp();
        auto writer = ArchiveWriter::create(path, take_info(3));
        ASSERT_TRUE(writer->write_target(full_target()).ok());
        ASSERT_TRUE(writer->finish().ok());
        file = path + "/cam0/target_000000.exr";
        good = headers_of(file);
        ASSERT_EQ(good.size(), 7u);
    }

    // What every way of reading says of a target of these parts.
    void expect_refused(const std::string& words, std::vector<Imf::Header> headers) {
        write_blank(file, headers);
        expect_file_refused(words);
    }
    void expect_file_refused(const std::string& words) {
        make_journal_agree(path);
        const auto archive = ArchiveReader::open(path);
        ASSERT_TRUE(archive.ok()) << archive.error().message;
        const auto read = archive->read_target(0, 0);
        const auto head = archive->read_head(0, 0);
        ASSERT_FALSE(read.ok() || head.ok()) << words;
        EXPECT_NE(read.error().message.find(words), std::string::npos) << words << ": " << read.error().message;
        EXPECT_NE(read.error().message.find("target_000000.exr"), std::string::npos);
        EXPECT_EQ(head.error().message, read.error().message);
        const auto found = archive->verify();
        EXPECT_TRUE(found.intact.empty());
        EXPECT_NE(joined(found.problems).find(words), std::string::npos) << joined(found.problems);
    }
    void expect_text_refused(const char* attribute, const std::string& words, const std::string& text) {
        auto headers = good;
        headers[0].insert(attribute, Imf::StringAttribute(text));
        expect_refused(words, headers);
    }

    std::string file;
    std::vector<Imf::Header> good;
};

TEST_F(TargetHeaders, a_file_that_openexr_wrote_in_the_layout_of_the_documentation_is_read) {
    write_blank(file, good);
    make_journal_agree(path);
    const auto archive = ArchiveReader::open(path);
    EXPECT_EQ(joined(archive->verify(true).problems), "");
    const auto target = archive->read_target(0, 0);
    ASSERT_TRUE(target.ok()) << target.error().message;
    EXPECT_EQ(target->lamps[2], Plane(70 * 66, 0.0f));
    EXPECT_EQ(target->matte.frames, 4);
}

TEST_F(TargetHeaders, missing_lamps_are_lamps_and_each_once) {
    for (const char* text : {"[3]", "[-1]", "[1e300]", "[0.5]", "[0,0]", "[\"0\"]", "[[0]]", "{\"0\":1}", "7", "null",
                             "[0", "", "[18446744073709551616]", "[4294967296]", "[true]", "[1,2,0,3]"})
        expect_text_refused("missingLamps", "missing", text);
    expect_text_refused("missingLamps", "nested deeper", std::string(100'000, '['));
    expect_text_refused("missingLamps", "missingLamps is damaged", "[\"\xff\"]");
}

TEST_F(TargetHeaders, texts_are_those_of_the_take) {
    for (const char* text : {"rgbg", "", "RGGB", "none ", "6"}) expect_text_refused("cfa", "no colour filter", text);
    expect_text_refused("basis", "basis is not the manifest's", "single");
    expect_text_refused("valueUnit", "valueUnit is not the manifest's", "pixel");
    expect_text_refused("lights", "lights is not the manifest's", "lamp_000 0 0 1\n");
    expect_text_refused("colorInteropID", "colorInteropID is not", "lin_rec709_scene\xff");
    expect_text_refused("provenance", "provenance is not the journal's", "{}");
    expect_text_refused("provenance", "provenance is damaged", "{\"cycle\":0,\"cycle\":0}");
    expect_text_refused("provenance", "nested deeper", "{\"a\":" + std::string(100'000, '['));
    expect_text_refused("provenance", "beyond all range", "[1e400]");
    expect_text_refused("provenance", "not JSON", "NaN");
    for (const char* attribute : {"missingLamps", "cfa", "basis", "provenance", "camera", "index", "lights"}) {
        auto headers = good;
        headers[0] = without(headers[0], attribute);
        expect_refused("it ", headers);
    }
    auto headers = good;
    headers[0] = without(headers[0], "cfa");
    headers[0].insert("cfa", Imf::IntAttribute(1));
    expect_refused("no colour filter", headers);
}

TEST_F(TargetHeaders, a_target_says_which_it_is) {
    for (const char* attribute : {"camera", "index"})
        for (const int number : {1, -1, 7}) {
            auto headers = good;
            headers[0].insert(attribute, Imf::IntAttribute(number));
            expect_refused(std::string("stands in the place of ") + attribute + " 0", headers);
        }
}

TEST_F(TargetHeaders, parts_are_there_once_and_of_one_size) {
    for (const size_t needed : {0, 1}) {
        auto headers = good;
        headers.erase(headers.begin() + std::ptrdiff_t(needed));
        expect_refused("it has no part", headers);
    }
    auto strange = good;
    strange[2].setName("depth");
    expect_refused("its part 2 is none", strange);
    for (size_t part = 0; part < good.size(); ++part) {
        auto narrow = good;
        narrow[part].dataWindow().max.x -= 1;
        expect_refused("display window", narrow);
    }
    auto moved = good;
    for (auto& header : moved)
        for (auto* window : {&header.dataWindow(), &header.displayWindow()}) window->min.x += 5, window->max.x += 5;
    expect_refused("does not begin at 0, 0", moved);
    for (size_t part = 0; part < good.size(); ++part) {
        auto tiles = good;
        tiles[part].setTileDescription(Imf::TileDescription(32, 64, Imf::ONE_LEVEL));
        expect_refused("tiles of 64 x 64", tiles);
        tiles[part].setTileDescription(Imf::TileDescription(64, 64, Imf::MIPMAP_LEVELS));
        expect_refused("of one level", tiles);
        auto lossy = good;
        lossy[part].compression() = Imf::PXR24_COMPRESSION;
        expect_refused("compressed as no archive's are", lossy);
    }
    auto crowd = good;
    crowd.push_back(good[6]);
    crowd.back().setName("more");
    expect_refused("more parts than", crowd);
}

// OpenEXR does not write such a file.
TEST_F(TargetHeaders, a_part_of_another_size_is_refused) {
    const std::string whole = read_text(file);
    const std::string windows[] = {std::string("dataWindow\0box2i\0\x10\0\0\0", 21),
                                   std::string("displayWindow\0box2i\0\x10\0\0\0", 24)};
    for (size_t part = 0; part < good.size(); ++part) {
        std::string bytes = whole;
        for (const std::string& mark : windows) {
            size_t at = bytes.find(mark);
            for (size_t i = 0; i < part; ++i) at = bytes.find(mark, at + 1);
            bytes[at + mark.size() + 8] = 68;  // the last column, 69 in the others
        }
        write_text(file, bytes);
        expect_file_refused("");
    }
}

TEST_F(TargetHeaders, channels_are_those_of_the_lamps_and_of_their_type) {
    for (size_t part = 0; part < good.size(); ++part) {
        const std::string first = good[part].channels().begin().name();
        auto more = good;
        more[part].channels().insert("extra", Imf::Channel(Imf::HALF));
        expect_refused("has a channel that the take has not", more);
        for (const Imf::PixelType type : {Imf::HALF, Imf::FLOAT, Imf::UINT}) {
            if (good[part].channels()[first.c_str()].type == type) continue;
            auto typed = good;
            typed[part].channels()[first.c_str()].type = type;
            expect_refused("samples of another type", typed);
        }
        auto renamed = good;
        Imf::ChannelList channels;
        for (auto it = good[part].channels().begin(); it != good[part].channels().end(); ++it)
            if (it.name() != first) channels.insert(it.name(), it.channel());
        if (channels.begin() == channels.end()) continue;  // a part needs one
        renamed[part].channels() = channels;
        if (part == 5) continue;  // a matte without its variance is a matte
        expect_refused("has no channel", renamed);
    }
}

TEST_F(TargetHeaders, motion_has_times_that_ascend_one_for_each_of_its_layers) {
    for (const char* text : {"[]", "[0.01]", "[-0.01,0.01,0.02]", "[0.01,-0.01]", "[0,0.01]", "[0.01,0.01]", "{}",
                             "[\"a\",\"b\"]", "[null,1]", "[-1e400,1]", "7", "[-0.01,NaN]"}) {
        auto headers = good;
        headers[6].insert("timesSeconds", Imf::StringAttribute(text));
        expect_refused("its part 'motion' ", headers);
    }
    auto headers = good;
    headers[6] = without(headers[6], "timesSeconds");
    expect_refused("its part 'motion' has times", headers);
    for (const int frames : {0, -1, std::numeric_limits<int>::min()}) {
        headers = good;
        headers[5].insert("frames", Imf::IntAttribute(frames));
        expect_refused("its part 'matte' does not say how many frames", headers);
    }
}

TEST_F(TargetHeaders, a_mosaic_has_all_its_colours) {
    for (const auto& [width, height] : {std::pair(1, 1), {1, 9}, {9, 1}}) {
        auto headers = good;
        for (auto& header : headers)
            header.dataWindow().max = header.displayWindow().max = Imath::V2i(width - 1, height - 1);
        expect_refused("does not hold all its colours", headers);
    }
}

// A file of some kilobytes that says it holds more than memory does: refused, and nothing is taken for it.
TEST_F(TargetHeaders, a_picture_that_the_file_cannot_hold_is_refused_before_memory_is_taken) {
    const std::string whole = read_text(file);
    const auto with_size = [&](int width, int height) {
        std::string bytes = whole;
        for (const std::string& mark :
             {std::string("dataWindow\0box2i\0\x10\0\0\0", 21), std::string("displayWindow\0box2i\0\x10\0\0\0", 24)})
            for (size_t at = 0; (at = bytes.find(mark, at)) != std::string::npos; ++at)
                for (int i = 0; i < 4; ++i) {
                    bytes[at + mark.size() + 8 + size_t(i)] = char(unsigned(width - 1) >> (8 * i));
                    bytes[at + mark.size() + 12 + size_t(i)] = char(unsigned(height - 1) >> (8 * i));
                }
        return bytes;
    };
    const auto peak_kb = [] {
        rusage usage{};
        getrusage(RUSAGE_SELF, &usage);
        return usage.ru_maxrss;
    };
    ASSERT_EQ(with_size(70, 66), whole);
    const long before = peak_kb();
    for (const auto& [width, height] : {std::pair(3000, 3000),
                                        {60000, 60000},
                                        {1 << 20, 1 << 20},
                                        {1 << 30, 1},
                                        {std::numeric_limits<int>::max(), std::numeric_limits<int>::max()},
                                        {0, 5},
                                        {-7, -7}}) {
        write_text(file, with_size(width, height));
        expect_file_refused("");
    }
    EXPECT_LT(peak_kb() - before, 64 << 10);
}

// The library makes room for what an attribute says that it holds.
TEST_F(TargetHeaders, an_attribute_larger_than_its_file_is_refused_before_memory_is_taken) {
    const std::string whole = read_text(file), mark("provenance\0string\0", 18);
    const size_t at = whole.find(mark) + mark.size();
    for (const uint32_t size : {0x7fffffffu, 0xffffffffu, 0x80000000u, uint32_t(whole.size())}) {
        std::string bytes = whole;
        for (int i = 0; i < 4; ++i) bytes[at + size_t(i)] = char(size >> (8 * i));
        write_text(file, bytes);
        expect_file_refused("larger than the file");
    }
    std::string typed = whole;
    typed.replace(whole.find(mark), mark.size(), std::string("provenance\0strinh\0", 18));
    write_text(file, typed);
    expect_file_refused("of a type that no target has");
    for (const size_t bytes : {size_t(0), size_t(3), size_t(8), size_t(9), at, whole.size() / 2}) {
        write_text(file, whole.substr(0, bytes));
        make_journal_agree(path);
        const auto archive = ArchiveReader::open(path);
        EXPECT_FALSE(archive->read_target(0, 0).ok()) << bytes;
    }
}
