// SPDX-License-Identifier: MIT
// A folder of a test's own, gone when it ends, and files in it.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace ols {

class ScratchFolder : public testing::Test {
  protected:
    ScratchFolder() { std::filesystem::create_directories(folder_); }
    ~ScratchFolder() override { std::filesystem::remove_all(folder_); }

    std::string write(const std::string& name, const std::string& bytes) {
        std::ofstream(folder_ / name, std::ios::binary) << bytes;
        return folder_ / name;
    }

    const std::filesystem::path folder_ =
        std::filesystem::temp_directory_path() /
        (std::string(testing::UnitTest::GetInstance()->current_test_info()->test_suite_name()) +
         std::to_string(getpid()));
};

}  // namespace ols
