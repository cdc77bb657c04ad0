// SPDX-License-Identifier: MIT
// Exceptions of libraries, and memory that ran out, as errors that say what was being done.
#pragma once

#include <exception>
#include <new>
#include <string>
#include <type_traits>
#include <utility>

#include "result.hpp"

namespace ols {

// What to tell of an exception.
inline std::string words_of(const std::exception& e) {
    if (dynamic_cast<const std::bad_alloc*>(&e) != nullptr)
        return "memory ran out: close other programs, or raise the limit (ulimit -v)";
    return e.what();
}

// What `work` returns, a Result; an exception becomes an error that begins with `action`: "cannot read 'take.rfa'".
template <typename Work>
std::invoke_result_t<Work> guarded(const std::string& action, Work&& work) {
    try {
        return std::forward<Work>(work)();
    } catch (const std::exception& e) {
        return fail(action + ": " + words_of(e));
    } catch (...) {
        return fail(action + ": a library gave up without a reason");
    }
}

}  // namespace ols
