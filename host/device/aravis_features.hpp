// SPDX-License-Identifier: MIT
// A GenICam device's features by their names (GenICam Standard Features Naming Convention 2.7), through Aravis: what there is, what
// it says, and whether it took what it was told.
#pragma once

#include <arv.h>

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ols {

struct ReleaseObject {
    void operator()(void* object) const { g_object_unref(object); }
};
template <typename Object>
using ObjectPointer = std::unique_ptr<Object, ReleaseObject>;

// A GLib error: give out() to a call, then look.
class LibraryError {
  public:
    LibraryError() = default;
    LibraryError(const LibraryError&) = delete;
    ~LibraryError() { g_clear_error(&error_); }
    GError** out() {
        g_clear_error(&error_);
        return &error_;
    }
    explicit operator bool() const { return error_ != nullptr; }
    std::string message() const { return error_ ? error_->message : ""; }
    bool is_of_link() const;  // the device could not be asked, whatever it would have answered

  private:
    GError* error_ = nullptr;
};

// For one thread. A feature that there is not, or not now, has no value and takes none; once the device gives no answer nothing
// more is asked of it, and broken() says so.
class AravisFeatures {
  public:
    explicit AravisFeatures(ArvDevice* device) : device_(device) {}

    bool has(const char* name);
    // The first of them that there is: newer names first, older ones after. nullptr when there is none.
    const char* first_of(std::initializer_list<const char*> names);

    std::optional<std::string> text(const char* name);
    std::optional<int64_t> integer(const char* name);
    std::optional<double> number(const char* name);  // of a float, or an integer
    std::optional<bool> flag(const char* name);
    std::optional<std::string> words(const char* name);  // of a feature of any kind
    std::vector<std::string> choices(const char* name);  // of an enumeration, those that can be had now
    struct Range {
        int64_t least, most, step;
    };
    std::optional<Range> range(const char* name);

    // Whether it was taken without a complaint: read back what it made of it.
    bool set(const char* name, const std::string& text);
    bool set_integer(const char* name, int64_t value);
    bool set_number(const char* name, double value);
    bool set_flag(const char* name, bool value);
    bool set_words(const char* name, const std::string& words);
    bool execute(const char* name);

    // Why the device gives no answer; empty while it does.
    const std::string& broken() const { return broken_; }

  private:
    bool took(const LibraryError& error);
    ArvGcNode* node(const char* name);

    ArvDevice* device_;
    std::string broken_;
};

}  // namespace ols
