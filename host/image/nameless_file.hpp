// SPDX-License-Identifier: MIT
// A file that no name leads to: it is gone when its program has ended, however that ended.
#pragma once

#include <string>

namespace ols {

// Its descriptor, for reading and writing, on the disk of `folder`; -1 with errno where none can be made.
int open_nameless_file(const std::string& folder);

}  // namespace ols
