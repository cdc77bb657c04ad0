// SPDX-License-Identifier: MIT
// Writes the GenICam description of a USB3 Vision camera with the features and registers of tests/gige, for the one of the guest's tests.
//
// usage: describe_camera FORMATS LACKS
// Both are lists with commas: pixel formats that it has (all when empty), and features that it does not have.
#include <cstdio>
#include <set>
#include <sstream>
#include <string>

#include "device_description.hpp"

namespace {

std::set<std::string> listed(const char* text) {
    std::istringstream words(text);
    std::set<std::string> list;
    for (std::string word; std::getline(words, word, ',');) list.insert(word);
    return list;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3) return std::fputs("usage: describe_camera FORMATS LACKS\n", stderr), 1;
    ols::test::DescriptionOptions options;
    options.pixel_formats = listed(argv[1]);
    options.lacks = listed(argv[2]);
    options.is_usb = true;
    std::fputs(ols::test::device_description(options).c_str(), stdout);
}
