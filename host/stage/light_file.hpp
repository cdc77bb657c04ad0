// SPDX-License-Identifier: MIT
// Text files of lights as other programs write them: .lp, and lists of numbers for each light.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

struct TextLine {
    int number = 0;  // from 1
    std::string text;
};

// The lines of a text file that are not empty: UTF-8, with or without a byte order mark, or UTF-16 with one (or with every other byte 0);
// lines end as on any system (LF, CR LF, CR). Errors name the file: not there, no regular file, over 64 MB, no text.
Result<std::vector<TextLine>> read_text_lines(const std::string& path);

// The numbers that a line ends with, with either decimal mark, and what stands before them.
struct NumberedName {
    std::string name;
    std::vector<double> numbers;
};
NumberedName split_numbers(const std::string& line);

struct LightFile {
    std::vector<LightPosition> lights;
    std::vector<int> lines;  // where each stands
    std::vector<std::array<double, 3>>
        intensities;  // of a column (or R G B) behind the directions; empty if there is none
};

// Reads an .lp file: the count, then `name x y z` a line, or `name x y z intensity`, or `name x y z R G B`, all lines alike. Names may
// hold spaces; a column of intensities is told from a number in a name by the picture's extension (`.png`) before it. Directions are
// normalised, whatever their length. Errors name file and line: a wrong count, a direction of 0, an intensity that is not above 0, a line
// that is no light, two lights in one direction (closer than 1e-6 rad: nobody can tell them apart).
Result<LightFile> read_light_file(const std::string& path);

}  // namespace ols
