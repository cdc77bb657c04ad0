// SPDX-License-Identifier: MIT
// Bounded parsing, and objects that keep account of what is wrong.
#include "image/json_object.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace ols {

using nlohmann::json;

namespace {

constexpr auto replaced = json::error_handler_t::replace;

bool is_deeper_than_allowed(std::string_view text) {
    int depth = 0;
    bool in_text = false;
    for (size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (in_text && c == '\\') {
            ++i;
        } else if (c == '"') {
            in_text = !in_text;
        } else if (!in_text) {
            depth += (c == '[' || c == '{') - (c == ']' || c == '}');
            if (depth > json_depth_max) return true;
        }
    }
    return false;
}

// What a key may be in a message: short, and UTF-8.
std::string shown(const std::string& text) {
    constexpr size_t longest = 60;
    return valid_utf8(text.size() <= longest ? text : text.substr(0, longest) + "...");
}

}  // namespace

const char* json_kind(const json& value) {
    switch (value.type()) {
        case json::value_t::null: return "null";
        case json::value_t::object: return "an object";
        case json::value_t::array: return "an array";
        case json::value_t::string: return "a text";
        case json::value_t::boolean: return "true or false";
        case json::value_t::number_unsigned: return "a whole number";
        case json::value_t::number_integer: return "a negative number";
        case json::value_t::number_float: return "a number with a fraction";
        default: return "nothing";
    }
}

std::string json_line(const json& value) {
    return value.dump(-1, ' ', false, replaced);
}

std::string valid_utf8(const std::string& text) {
    return json::parse(json_line(text)).get<std::string>();
}

Result<json> parse_json(std::string_view text, const std::string& source) {
    if (is_deeper_than_allowed(text))
        return fail(fmt::format("{} is damaged: it is nested deeper than {} values", source, json_depth_max));
    std::vector<std::set<std::string>> keys;
    std::string twice;
    const auto look = [&](int, json::parse_event_t event, json& parsed) {
        if (event == json::parse_event_t::object_start) keys.emplace_back();
        if (event == json::parse_event_t::object_end) keys.pop_back();
        if (event == json::parse_event_t::key && twice.empty())
            if (const auto& key = parsed.get_ref<const std::string&>(); !keys.back().insert(key).second) twice = key;
        return true;
    };
    try {
        json value = json::parse(text, look);
        if (!twice.empty()) return fail(fmt::format("{} is damaged: it has '{}' twice", source, shown(twice)));
        return value;
    } catch (const json::parse_error& e) {
        return fail(fmt::format("{} is damaged: it is not JSON at byte {}", source, e.byte));
    } catch (const json::out_of_range&) {
        return fail(fmt::format("{} is damaged: it has a number beyond all range", source));
    }
}

struct JsonObject::Account {
    std::string lead, error;  // what begins every error
    // Every object that was looked into, and the keys that were asked for.
    struct Visited {
        const json* object;
        std::string prefix;
        std::shared_ptr<std::set<std::string>> asked;
    };
    std::vector<Visited> visited;

    void reject(const std::string& path, const std::string& what) {
        if (error.empty()) error = fmt::format("{}: {} {}", lead, path, what);
    }
};

JsonObject::JsonObject(const json& value, const std::string& source, const std::string& verdict)
    : JsonObject(&value, std::make_shared<Account>(Account{source + " " + verdict, "", {}}), "") {}

JsonObject::JsonObject(const json* value, std::shared_ptr<Account> account, std::string prefix)
    : json_(value),
      account_(std::move(account)),
      prefix_(std::move(prefix)),
      asked_(std::make_shared<std::set<std::string>>()) {
    if (json_ && !json_->is_object()) {
        account_->reject(prefix_.empty() ? "it" : prefix_.substr(0, prefix_.size() - 1),
                         fmt::format("is {}, not an object", json_kind(*json_)));
        json_ = nullptr;
    }
    if (json_) account_->visited.push_back({json_, prefix_, asked_});
}

bool JsonObject::has(const std::string& key) const {
    return json_ && json_->contains(key);
}

const json* JsonObject::find(const std::string& key) {
    if (!json_) return nullptr;
    asked_->insert(key);
    const auto found = json_->find(key);
    if (found != json_->end()) return &*found;
    reject(key, "is missing");
    return nullptr;
}

const json* JsonObject::find(const std::string& key, bool (json::*is_kind)() const noexcept, const char* kind) {
    const json* value = find(key);
    if (!value || (value->*is_kind)()) return value;
    reject(key, fmt::format("is {}, not {}", json_kind(*value), kind));
    return nullptr;
}

std::string JsonObject::text(const std::string& key) {
    const json* value = find(key, &json::is_string, "a text");
    return value ? value->get<std::string>() : "";
}

bool JsonObject::boolean(const std::string& key) {
    const json* value = find(key, &json::is_boolean, "true or false");
    return value && value->get<bool>();
}

double JsonObject::number(const std::string& key, double min, double max) {
    const json* value = find(key, &json::is_number, "a number");
    if (!value) return 0;
    const double number = value->get<double>();
    if (!(number >= min && number <= max)) reject(key, fmt::format("is {}, not from {} to {}", number, min, max));
    return number;
}

uint64_t JsonObject::count(const std::string& key, uint64_t max) {
    const json* value = find(key, &json::is_number_unsigned, "a whole number from 0");
    if (!value) return 0;
    const auto count = value->get<uint64_t>();
    if (count <= max) return count;
    reject(key, fmt::format("is {}, beyond {}", count, max));
    return 0;
}

std::vector<double> JsonObject::numbers(const std::string& key) {
    const json* value = find(key, &json::is_array, "an array of numbers");
    if (!value) return {};
    if (!std::ranges::all_of(*value, [](const json& entry) { return entry.is_number(); })) {
        reject(key, "is not an array of numbers");
        return {};
    }
    return value->get<std::vector<double>>();
}

JsonObject JsonObject::object(const std::string& key) {
    return {find(key), account_, prefix_ + key + "."};
}

std::vector<JsonObject> JsonObject::objects(const std::string& key) {
    const json* value = find(key, &json::is_array, "an array");
    std::vector<JsonObject> all;
    if (!value) return all;
    for (const json& entry : *value)
        all.push_back({&entry, account_, fmt::format("{}{}[{}].", prefix_, key, all.size())});
    return all;
}

json JsonObject::any(const std::string& key) {
    const json* value = find(key);
    return value ? *value : json();
}

void JsonObject::reject(const std::string& key, const std::string& what) {
    account_->reject(prefix_ + key, what);
}

Status JsonObject::first_error() const {
    return account_->error.empty() ? Status(Done{}) : fail(account_->error);
}

Status JsonObject::finish() const {
    if (const Status read = first_error(); !read) return read;
    for (const auto& [object, prefix, asked] : account_->visited)
        for (const auto& [key, value] : object->items())
            if (!asked->contains(key))
                return fail(fmt::format("{}: {}{} is no key of this version", account_->lead, prefix, shown(key)));
    return Done{};
}

}  // namespace ols
