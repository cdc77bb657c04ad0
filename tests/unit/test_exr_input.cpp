// SPDX-License-Identifier: MIT
// The stream that OpenEXR reads a target through: a file may say that its tiles lie anywhere, and nothing beyond it is read.
// links: ols_archive
#include "archive/exr_input.hpp"

#include <gtest/gtest.h>

#include <array>
#include <stdexcept>

#include "scratch_folder.hpp"

namespace ols {
namespace {

class ExrInputFile : public ScratchFolder {};

TEST_F(ExrInputFile, reads_at_any_place_within_the_file_and_nowhere_else) {
    std::string content(100'000, '\0');
    for (size_t i = 0; i < content.size(); ++i) content[i] = char(i * 37 % 251);
    write("a.exr", content);
    const auto file = ArchiveFile::open(folder_, "a.exr");
    ASSERT_TRUE(file.ok());
    std::array<char, 70'000> bytes;
    for (const int count : {1, 4, 4096, 70'000}) {
        ExrInput input(*file);
        const uint64_t last = content.size() - size_t(count);
        for (const uint64_t place : {uint64_t(0), last / 2, uint64_t(7), last}) {
            input.seekg(place);
            EXPECT_EQ(input.read(bytes.data(), count), place < last);
            EXPECT_EQ(content.compare(place, size_t(count), bytes.data(), size_t(count)), 0) << place << " " << count;
        }
        for (const uint64_t place : {last + 1, uint64_t(content.size()), uint64_t(1) << 40, UINT64_MAX - 70'000,
                                     UINT64_MAX - 3, UINT64_MAX - 1, UINT64_MAX}) {
            input.seekg(place);
            EXPECT_THROW(input.read(bytes.data(), count), std::runtime_error) << place << " " << count;
        }
    }
}

}  // namespace
}  // namespace ols
