// SPDX-License-Identifier: MIT
// Which edges did not come.
#include "device/gpio.hpp"

namespace ols {

void EdgeAccount::add(bool is_active) {
    ++seen_;
    lost_ += last_ == level_of(is_active);
    last_ = level_of(is_active);
    doubt_ = unknown;
}

void EdgeAccount::look(bool is_active) {
    const Level level = level_of(is_active);
    if (last_ == unknown || level == last_) {
        last_ = level;
        doubt_ = unknown;
    } else if (doubt_ == level) {
        ++lost_;
        last_ = level;
        doubt_ = unknown;
    } else {
        doubt_ = level;
    }
}

}  // namespace ols
