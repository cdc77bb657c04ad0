// SPDX-License-Identifier: MIT
// A mapped file that is cut short under its reader gives zeros and says so; other files' mappings, and other causes of SIGBUS, are
// as they were.
// links: ols_device
#include "device/guarded_mapping.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <vector>

using namespace ols;

namespace {

constexpr size_t page_bytes = 4096, file_bytes = 4 * page_bytes;

struct File {
    File() : fd(memfd_create("guarded", MFD_CLOEXEC)) {
        const std::string content(file_bytes, 'x');
        EXPECT_EQ(pwrite(fd, content.data(), content.size(), 0), ssize_t(file_bytes));
    }
    ~File() { ::close(fd); }
    int fd;
};

char read(const GuardedMapping& mapping, size_t at) {
    return char(*(volatile const std::byte*)(mapping.data() + at));
}

}  // namespace

TEST(GuardedMapping, a_whole_file_is_read_and_written_as_it_is) {
    const File file;
    const GuardedMapping mapping(file.fd, file_bytes);
    ASSERT_NE(mapping.data(), nullptr);
    EXPECT_EQ(read(mapping, file_bytes - 1), 'x');
    mapping.data()[5] = std::byte('y');
    char byte = 0;
    EXPECT_EQ(pread(file.fd, &byte, 1, 5), 1);
    EXPECT_EQ(byte, 'y');
    EXPECT_FALSE(mapping.cut());
}

TEST(GuardedMapping, beyond_the_end_of_a_file_that_was_cut_there_are_zeros_and_it_says_so) {
    const File file, other;
    GuardedMapping mapping(file.fd, file_bytes);
    const GuardedMapping whole(other.fd, file_bytes);
    ASSERT_EQ(ftruncate(file.fd, page_bytes), 0);
    EXPECT_EQ(read(mapping, 0), 'x');
    EXPECT_FALSE(mapping.cut()) << "nothing beyond the end was looked at";
    EXPECT_EQ(read(mapping, 3 * page_bytes), 0);
    EXPECT_TRUE(mapping.cut());
    EXPECT_EQ(read(mapping, 0), 0) << "all of it, from then on";
    mapping.data()[2 * page_bytes] = std::byte('z');  // lost
    const GuardedMapping moved = std::move(mapping);
    EXPECT_TRUE(moved.cut());
    EXPECT_EQ(read(whole, 0), 'x');
    EXPECT_FALSE(whole.cut());
}

TEST(GuardedMapping, a_write_beyond_the_end_is_lost_and_said) {
    const File file;
    const GuardedMapping mapping(file.fd, file_bytes);
    ASSERT_EQ(ftruncate(file.fd, 0), 0);
    mapping.data()[page_bytes] = std::byte('z');
    EXPECT_TRUE(mapping.cut());
}

TEST(GuardedMapping, places_are_given_back_and_no_room_is_an_empty_mapping) {
    const File file;
    for (int round = 0; round < 3; ++round) {
        std::vector<GuardedMapping> mappings;
        while (mappings.empty() || mappings.back().data()) mappings.emplace_back(file.fd, file_bytes);
        EXPECT_GE(mappings.size(), 60u);
        EXPECT_LE(mappings.size(), 65u);
    }
    ASSERT_EQ(ftruncate(file.fd, 0), 0);
    const GuardedMapping after(file.fd, file_bytes);
    EXPECT_EQ(read(after, 0), 0);
    EXPECT_TRUE(after.cut());
}

TEST(GuardedMapping, what_cannot_be_mapped_is_empty) {
    EXPECT_EQ(GuardedMapping(-1, file_bytes).data(), nullptr);
    EXPECT_FALSE(GuardedMapping().cut());
}

TEST(GuardedMappingDeathTest, a_sigbus_of_anything_else_ends_the_process_as_ever) {
    const auto cut_a_mapping_of_others = [] {
        const File file;
        const GuardedMapping guarded(file.fd, file_bytes);
        signal(SIGSEGV, SIG_DFL);
        auto* others = static_cast<volatile char*>(mmap(nullptr, file_bytes, PROT_READ, MAP_SHARED, file.fd, 0));
        (void)!ftruncate(file.fd, 0);
        (void)others[page_bytes];
    };
    EXPECT_DEATH(cut_a_mapping_of_others(), "");
}
