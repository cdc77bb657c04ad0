// SPDX-License-Identifier: MIT
// Which file of a folder a light of an .lp file means.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "result.hpp"
#include "stage/lamps.hpp"

namespace ols {

// What stands after the last slash of either kind.
std::string base_name(const std::string& path);

// The names of the regular files of a folder.
Result<std::set<std::string>> file_names(const std::string& folder);

// For each light the path, relative to the folder, of its picture: the path as it stands in the .lp file (with slashes of either
// kind), else its last part, else that in another Unicode form (NFC and NFD are one) or letter case. Errors: pictures that are not
// there, names that may mean several files, two lights with one picture.
Result<std::vector<std::string>> match_pictures(const std::vector<LightPosition>& lights, const std::string& lp,
                                                const std::string& folder);

}  // namespace ols
