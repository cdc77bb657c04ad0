// SPDX-License-Identifier: MIT
// Strict reading of TOML over toml++; its exceptions are off and its types stay in this file.
#include "stage/toml_section.hpp"

#define TOML_EXCEPTIONS 0
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <optional>
#include <set>

namespace ols {

struct TomlSection::File {
    std::string path;
    toml::table root;
    std::set<const toml::node*> read;
    std::set<std::string> asked;  // with the dots before them, whether they were there or not
    std::optional<Error> first_error;

    void note(const toml::source_region& where, const std::string& message) {
        if (!first_error) first_error = fail(fmt::format("{}:{}: {}", path, where.begin.line, message));
    }
};

namespace {

const toml::table& as_table(const void* table) {
    return *static_cast<const toml::table*>(table);
}

const toml::node* as_node(const void* node) {
    return static_cast<const toml::node*>(node);
}

// How many letters must be put in, left out or changed to make one word of the other (Levenshtein 1966).
size_t edit_distance(const std::string& a, const std::string& b) {
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t(0));
    for (size_t i = 1; i <= a.size(); ++i) {
        size_t diagonal = row[0]++;
        for (size_t j = 1; j <= b.size(); ++j) {
            const size_t changed = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row.back();
}

// A dotted name's table, with its dot, and its key.
std::pair<std::string, std::string> split_name(const std::string& name) {
    const size_t begin = name.rfind('.') + 1;  // 0 without a dot
    return {name.substr(0, begin), name.substr(begin)};
}

// The first key, in file order, that was never asked for, with the dots before it.
using Unread = std::pair<std::string, toml::source_region>;
std::optional<Unread> find_unread(const toml::table& table, const std::set<const toml::node*>& read,
                                  const std::string& prefix) {
    std::optional<Unread> first;
    const auto consider = [&](Unread unread) {
        if (!first || unread.second.begin.line < first->second.begin.line) first = std::move(unread);
    };
    for (const auto& [key, node] : table) {
        const std::string name = prefix + std::string(key.str());
        if (!read.contains(&node)) {
            consider({name, node.source()});
            continue;
        }
        if (const auto* inner = node.as_table())
            if (auto unread = find_unread(*inner, read, name + ".")) consider(std::move(*unread));
        if (const auto* list = node.as_array())
            for (const auto& entry : *list)
                if (const auto* inner = entry.as_table())
                    if (auto unread = find_unread(*inner, read, name + ".")) consider(std::move(*unread));
    }
    return first;
}

}  // namespace

TomlSection::TomlSection(std::shared_ptr<File> file, const void* table, std::string prefix)
    : file_(std::move(file)), table_(table), prefix_(std::move(prefix)) {}

Result<TomlSection> TomlSection::open(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error))
        return fail("cannot open '" + path + "': there is no such file; check the path");
    toml::parse_result parsed = toml::parse_file(path);
    if (!parsed)
        return fail(fmt::format("{}:{}: {}", path, parsed.error().source().begin.line, parsed.error().description()));
    auto file = std::make_shared<File>();
    file->path = path;
    file->root = std::move(parsed).table();
    const void* root = &file->root;
    return TomlSection(std::move(file), root, "");
}

const void* TomlSection::find(const std::string& key) {
    const toml::node* node = as_table(table_).get(key);
    file_->asked.insert(prefix_ + key);
    if (node) file_->read.insert(node);
    return node;
}

bool TomlSection::has(const std::string& key) const {
    file_->asked.insert(prefix_ + key);
    return as_table(table_).get(key) != nullptr;
}

void TomlSection::reject(const std::string& key, const std::string& what) {
    const toml::node* node = as_table(table_).get(key);
    file_->note(node ? node->source() : as_table(table_).source(), prefix_ + key + " " + what);
}

void TomlSection::read(const std::string& key, double& value, double min, double max) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const auto number = node->value<double>();
    if (!number || !std::isfinite(*number) || *number < min || *number > max)
        return reject(key, fmt::format("must be a number from {} to {}", min, max));
    value = *number;
}

void TomlSection::read(const std::string& key, int& value, int min, int max) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const auto number = node->value_exact<int64_t>();
    if (!number || *number < min || *number > max)
        return reject(key, fmt::format("must be a whole number from {} to {}", min, max));
    value = int(*number);
}

void TomlSection::read(const std::string& key, bool& value) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const auto flag = node->value_exact<bool>();
    if (!flag) return reject(key, "must be true or false");
    value = *flag;
}

void TomlSection::read(const std::string& key, std::string& value) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const auto text = node->value_exact<std::string>();
    if (!text) return reject(key, "must be a text in quotes");
    value = *text;
}

void TomlSection::read(const std::string& key, std::vector<int>& value, int min, int max) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    std::vector<int> numbers;
    if (const auto* list = node->as_array())
        for (const auto& entry : *list)
            if (const auto number = entry.value_exact<int64_t>(); number && *number >= min && *number <= max)
                numbers.push_back(int(*number));
    if (!node->is_array() || numbers.size() != node->as_array()->size())
        return reject(key, fmt::format("must be a list of whole numbers from {} to {}", min, max));
    value = std::move(numbers);
}

void TomlSection::read(const std::string& key, std::vector<std::string>& value) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    std::vector<std::string> texts;
    if (const auto* list = node->as_array())
        for (const auto& entry : *list)
            if (const auto text = entry.value_exact<std::string>()) texts.push_back(*text);
    if (!node->is_array() || texts.size() != node->as_array()->size()) return reject(key, "must be a list of texts");
    value = std::move(texts);
}

void TomlSection::read(const std::string& key, std::array<double, 3>& value) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    std::vector<double> numbers;
    if (const auto* list = node->as_array())
        for (const auto& entry : *list)
            if (const auto number = entry.value<double>(); number && std::isfinite(*number)) numbers.push_back(*number);
    if (!node->is_array() || numbers.size() != 3 || node->as_array()->size() != 3)
        return reject(key, "must be a list of three numbers");
    std::copy(numbers.begin(), numbers.end(), value.begin());
}

TomlSection TomlSection::section(const std::string& key) {
    static const toml::table empty;
    const toml::node* node = as_node(find(key));
    if (node && !node->is_table()) reject(key, "must be a table: write [" + prefix_ + key + "]");
    const toml::table* table = node && node->is_table() ? node->as_table() : &empty;
    return TomlSection(file_, table, prefix_ + key + ".");
}

std::vector<TomlSection> TomlSection::sections(const std::string& key) {
    std::vector<TomlSection> found;
    const toml::node* node = as_node(find(key));
    if (!node) return found;
    const toml::array* list = node->as_array();
    if (list)
        for (const auto& entry : *list)
            if (const auto* table = entry.as_table()) found.push_back(TomlSection(file_, table, prefix_ + key + "."));
    if (!list || found.size() != list->size()) reject(key, "must be tables: write [[" + prefix_ + key + "]]");
    return found;
}

std::string TomlSection::describe_unread(const std::string& name) const {
    const auto [table, key] = split_name(name);
    size_t nearest = std::max<size_t>(1, key.size() / 3) + 1;  // with more letters wrong it is another word
    std::string meant, elsewhere, known;
    for (const std::string& asked : file_->asked) {
        const auto [asked_table, asked_key] = split_name(asked);
        if (asked_table != table) {
            if (asked_key != key) continue;
            elsewhere += elsewhere.empty() ? "" : " or ";
            elsewhere += asked_table.empty() ? "before the file's first table"
                                             : "in the table " + asked_table.substr(0, asked_table.size() - 1);
            continue;
        }
        known += (known.empty() ? "" : ", ") + asked_key;
        const bool lacks_unit = asked_key.starts_with(key + "_");
        if (const size_t distance = lacks_unit ? 1 : edit_distance(key, asked_key); distance < nearest) {
            nearest = distance;
            meant = asked_key;
        }
    }
    if (!elsewhere.empty()) return "it belongs " + elsewhere;
    if (!meant.empty()) return "did you mean " + meant + "?";
    return known.empty() ? "nothing may stand there" : "known there: " + known;
}

Status TomlSection::finish() const {
    if (file_->first_error) return *file_->first_error;
    if (const auto unread = find_unread(file_->root, file_->read, ""))
        return fail(fmt::format("{}:{}: {} is not a key that is known here; {}", file_->path, unread->second.begin.line,
                                unread->first, describe_unread(unread->first)));
    return Done{};
}

std::string TomlSection::resolve_path(const std::string& path) const {
    return (std::filesystem::path(file_->path).parent_path() / path).lexically_normal().string();
}

}  // namespace ols
