// SPDX-License-Identifier: MIT
// Strict reading of TOML over toml++; its exceptions and its types stay in this file.
#include "stage/toml_section.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>

#include "image/input_file.hpp"
#include "stage/toml_outline.hpp"

// toml++ 3.3 asserts what some texts do not hold. Its asserts are thrown, in builds without asserts, too, and with exceptions
// an error ends the parsing where it is found.
[[noreturn]] static void toml_assert_failed() {
    throw std::logic_error(
        "this is no TOML, and its parser cannot say which line: look for brackets that name nothing");
}
#undef NDEBUG
#define TOML_ASSERT(expression) ((expression) ? void() : toml_assert_failed())
#define TOML_EXCEPTIONS 1
#include <toml++/toml.h>

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

constexpr uint64_t file_bytes_max = 4 << 20;  // a cycle of 1024 slots with a level for each of 256 lamps takes 1.3 MB
constexpr size_t text_bytes_max = 4096, list_entries_max = 4096;

const toml::table& as_table(const void* table) {
    return *static_cast<const toml::table*>(table);
}

const toml::node* as_node(const void* node) {
    return static_cast<const toml::node*>(node);
}

// A whole number is a number, too; true, a text or a date are none.
std::optional<double> number_of(const toml::node& node) {
    if (const auto whole = node.value_exact<int64_t>()) return double(*whole);
    return node.value_exact<double>();
}

bool lies_in(double value, double min, double max) {
    return value >= min && value <= max;  // false for NaN
}

bool is_plain(const std::string& text) {
    return text.size() <= text_bytes_max &&
           std::none_of(text.begin(), text.end(), [](char c) { return (c >= 0 && c < ' ') || c == 127; });
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
    const auto text = read_input(path, "configuration", file_bytes_max);
    if (!text) return text.error();
    if (const Status bounded = check_toml_outline(path, *text); !bounded) return bounded.error();
    auto file = std::make_shared<File>();
    file->path = path;
    try {
        file->root = toml::parse(*text, path);
    } catch (const toml::parse_error& e) {
        return fail(fmt::format("{}:{}: {}", path, e.source().begin.line, e.description()));
    } catch (const std::exception& e) {
        return fail(fmt::format("cannot read '{}': {}", path, e.what()));
    }
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
    const auto number = number_of(*node);
    if (!number || !lies_in(*number, min, max))
        return reject(key, fmt::format("must be a number from {} to {}", min, max));
    value = *number;
}

void TomlSection::read(const std::string& key, int64_t& value, int64_t min, int64_t max) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const auto number = node->value_exact<int64_t>();
    if (!number || *number < min || *number > max)
        return reject(key, fmt::format("must be a whole number from {} to {}", min, max));
    value = *number;
}

void TomlSection::read(const std::string& key, int& value, int min, int max) {
    int64_t number = value;
    read(key, number, int64_t(min), int64_t(max));
    value = int(number);
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
    if (!text || !is_plain(*text))
        return reject(key, fmt::format("must be a text in quotes, of at most {} bytes and without control characters",
                                       text_bytes_max));
    value = *text;
}

// The entries of a list, each made by `entry` of its node; nothing if one of them is none, or there are too many.
template <typename T, typename Entry>
static std::optional<std::vector<T>> list_of(const toml::node& node, size_t most, const Entry& entry) {
    const toml::array* list = node.as_array();
    if (!list || list->size() > most) return std::nullopt;
    std::vector<T> values;
    for (const toml::node& each : *list) {
        const std::optional<T> value = entry(each);
        if (!value) return std::nullopt;
        values.push_back(*value);
    }
    return values;
}

void TomlSection::read(const std::string& key, std::vector<int>& value, int min, int max) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    auto numbers = list_of<int>(*node, list_entries_max, [&](const toml::node& entry) -> std::optional<int> {
        const auto number = entry.value_exact<int64_t>();
        if (!number || *number < min || *number > max) return std::nullopt;
        return int(*number);
    });
    if (!numbers)
        return reject(
            key, fmt::format("must be a list of at most {} whole numbers from {} to {}", list_entries_max, min, max));
    value = std::move(*numbers);
}

void TomlSection::read(const std::string& key, std::vector<std::string>& value) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    auto texts = list_of<std::string>(*node, list_entries_max, [](const toml::node& entry) {
        auto text = entry.value_exact<std::string>();
        return text && is_plain(*text) ? text : std::nullopt;
    });
    if (!texts) return reject(key, fmt::format("must be a list of at most {} texts", list_entries_max));
    value = std::move(*texts);
}

void TomlSection::read(const std::string& key, std::array<double, 3>& value, double min, double max) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const auto numbers = list_of<double>(*node, 3, [&](const toml::node& entry) {
        const auto number = number_of(entry);
        return number && lies_in(*number, min, max) ? number : std::nullopt;
    });
    if (!numbers || numbers->size() != 3)
        return reject(key, fmt::format("must be a list of three numbers from {} to {}", min, max));
    std::copy(numbers->begin(), numbers->end(), value.begin());
}

static std::optional<std::string> text_of(const toml::node& node) {
    if (const auto flag = node.value_exact<bool>()) return *flag ? "true" : "false";
    if (const auto whole = node.value_exact<int64_t>()) return fmt::format("{}", *whole);
    if (const auto number = node.value_exact<double>()) return fmt::format("{}", *number);
    auto text = node.value_exact<std::string>();
    return text && is_plain(*text) ? text : std::nullopt;
}

void TomlSection::read(const std::string& key, std::map<std::string, std::string>& value) {
    const toml::node* node = as_node(find(key));
    if (!node) return;
    const toml::table* table = node->as_table();
    if (!table || table->size() > list_entries_max)
        return reject(key, "must be a table of settings by their names: { \"Gain\" = 12 }");
    for (const auto& [name, entry] : *table) {
        file_->read.insert(&entry);
        const auto text = text_of(entry);
        if (!text || !is_plain(std::string(name.str())))
            return reject(key, fmt::format("must give \"{}\" one text, number, true or false", name.str()));
        value[std::string(name.str())] = *text;
    }
}

void TomlSection::read_direction(const std::string& key, std::array<double, 3>& value) {
    std::array<double, 3> read_value = value;
    read(key, read_value, -direction_max, direction_max);
    if (std::hypot(read_value[0], read_value[1], read_value[2]) < 1e-6)
        return reject(key, "must be longer than 0.000001: it is a direction");
    value = read_value;
}

TomlSection TomlSection::section(const std::string& key) {
    static const toml::table empty;
    const toml::node* node = as_node(find(key));
    if (node && !node->is_table()) reject(key, "must be a table: write [" + prefix_ + key + "]");
    const toml::table* table = node && node->is_table() ? node->as_table() : &empty;
    return TomlSection(file_, table, prefix_ + key + ".");
}

std::vector<TomlSection> TomlSection::sections(const std::string& key, size_t most) {
    std::vector<TomlSection> found;
    const toml::node* node = as_node(find(key));
    if (!node) return found;
    const toml::array* list = node->as_array();
    if (list)
        for (const auto& entry : *list)
            if (const auto* table = entry.as_table()) found.push_back(TomlSection(file_, table, prefix_ + key + "."));
    if (!list || found.size() != list->size()) reject(key, "must be tables: write [[" + prefix_ + key + "]]");
    if (found.size() > most) {
        reject(key, fmt::format("has {} tables and may have {}", found.size(), most));
        found.clear();
    }
    return found;
}

std::string TomlSection::place(const std::string& key) const {
    const toml::node* node = as_table(table_).get(key);
    const toml::source_region& where = node ? node->source() : as_table(table_).source();
    return fmt::format("{}:{}: {}{}", file_->path, where.begin.line, prefix_, key);
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
