// SPDX-License-Identifier: MIT
// Strict reading of JSON that may come from anywhere: text is bounded before it is parsed, every value is of the kind that is
// asked for or the error names file and key, and a key that nobody asked for is an error, too.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "result.hpp"

namespace ols {

// Values within values; far from what the stack of a recursive copy or dump holds.
inline constexpr int json_depth_max = 64;

// Errors name `source` ("'take.rfa/manifest.json'"): no JSON (text that is not UTF-8 and numbers beyond a double are none), nested
// deeper than json_depth_max, a key that stands twice in one object. Takes up to 100 times the text's size in memory.
Result<nlohmann::json> parse_json(std::string_view text, const std::string& source);

// The text with what is not UTF-8 replaced, as JSON has to be written.
std::string valid_utf8(const std::string& text);

// A single line of JSON, of any values: with what is not UTF-8 replaced.
std::string json_line(const nlohmann::json& json);

// An object inside a JSON value that outlives it. The functions return a value of the kind asked for; where there is none, one
// that is empty or 0, and the first thing that is wrong in the whole value is kept for finish().
class JsonObject {
  public:
    // `source` and `verdict` begin every error.
    JsonObject(const nlohmann::json& json, const std::string& source, const std::string& verdict = "is damaged");

    bool has(const std::string& key) const;
    std::string text(const std::string& key);
    bool boolean(const std::string& key);
    double number(const std::string& key, double min, double max);
    uint64_t count(const std::string& key, uint64_t max);  // a whole number from 0
    std::vector<double> numbers(const std::string& key);
    JsonObject object(const std::string& key);
    std::vector<JsonObject> objects(const std::string& key);  // an array of objects
    nlohmann::json any(const std::string& key);

    // Notes that a value is wrong in a way that the functions cannot know: `what` follows "source: key ".
    void reject(const std::string& key, const std::string& what);

    // The first wrong value so far.
    Status first_error() const;

    // The first error of the whole value: a wrong value, or a key that nobody asked for.
    Status finish() const;

  private:
    struct Account;
    JsonObject(const nlohmann::json* json, std::shared_ptr<Account> account, std::string prefix);
    const nlohmann::json* find(const std::string& key);
    const nlohmann::json* find(const std::string& key, bool (nlohmann::json::*is_kind)() const noexcept,
                               const char* kind);

    const nlohmann::json* json_;  // null where there is no object
    std::shared_ptr<Account> account_;
    std::string prefix_;  // "slate.", for messages
    std::shared_ptr<std::set<std::string>> asked_;
};

// "a text", "an array" ...: what a value is.
const char* json_kind(const nlohmann::json& value);

}  // namespace ols
