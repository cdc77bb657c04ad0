// SPDX-License-Identifier: MIT
// Result<T>: a value or an error message that tells the user what to do. What comes from outside (devices, files,
// users) returns one; bugs are asserted; exceptions of libraries stop at their wrapper.
#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace ols {

struct Error {
    std::string message;
};

// An error made in place: `return fail("cannot open '" + path + "': check the path");`
inline Error fail(std::string message) {
    return Error{std::move(message)};
}

template <typename T>
class [[nodiscard]] Result {
  public:
    Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

    bool ok() const { return state_.index() == 0; }
    explicit operator bool() const { return ok(); }

    T& value() {
        assert(ok());
        return std::get<0>(state_);
    }
    const T& value() const {
        assert(ok());
        return std::get<0>(state_);
    }
    T& operator*() { return value(); }
    const T& operator*() const { return value(); }
    T* operator->() { return &value(); }
    const T* operator->() const { return &value(); }

    const Error& error() const {
        assert(!ok());
        return std::get<1>(state_);
    }

  private:
    std::variant<T, Error> state_;
};

struct Done {};
using Status = Result<Done>;

}  // namespace ols
