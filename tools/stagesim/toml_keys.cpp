// SPDX-License-Identifier: MIT
// Messages name file, line, table and key.
#include "toml_keys.hpp"

#include <fmt/format.h>

#include <cmath>

namespace ols {

const toml::node* TomlKeys::find(const std::string& key) {
    known_.insert(key);
    return table_.get(key);
}

void TomlKeys::complain(const std::string& key, const std::string& why) {
    if (!error_.empty()) return;
    const toml::node* node = table_.get(key);
    const auto line = (node ? node : &table_)->source().begin.line;
    error_ = fmt::format("{}:{}: {}.{}: {}", file_, line, what_, key, why);
}

double TomlKeys::number(const std::string& key, double otherwise, double low, double high) {
    const toml::node* node = find(key);
    if (!node) return otherwise;
    const auto value = node->value<double>();
    if (!value || !(*value >= low && *value <= high)) {
        complain(key, fmt::format("must be a number from {:g} to {:g}", low, high));
        return otherwise;
    }
    return *value;
}

std::string TomlKeys::text(const std::string& key, const std::string& otherwise) {
    const toml::node* node = find(key);
    if (!node) return otherwise;
    if (!node->is_string()) complain(key, "must be a string");
    return node->value_or(otherwise);
}

bool TomlKeys::flag(const std::string& key, bool otherwise) {
    const toml::node* node = find(key);
    if (!node) return otherwise;
    if (!node->is_boolean()) complain(key, "must be true or false");
    return node->value_or(otherwise);
}

Vec3 TomlKeys::triple(const std::string& key, Vec3 otherwise) {
    const toml::node* node = find(key);
    if (!node) return otherwise;
    const toml::array* array = node->as_array();
    double v[3] = {0, 0, 0};
    bool good = array && array->size() == 3;
    for (size_t i = 0; good && i < 3; ++i) {
        const auto value = array->get(i)->value<double>();
        good = value && std::isfinite(*value);
        if (good) v[i] = *value;
    }
    if (!good) complain(key, "must be three numbers, [x, y, z]");
    return good ? Vec3{v[0], v[1], v[2]} : otherwise;
}

const toml::table* TomlKeys::table(const std::string& key) {
    const toml::node* node = find(key);
    if (node && !node->is_table()) complain(key, "must be a table");
    return node ? node->as_table() : nullptr;
}

const toml::array* TomlKeys::tables(const std::string& key) {
    const toml::node* node = find(key);
    if (node && !node->is_array_of_tables()) complain(key, fmt::format("must be tables written [[{}]]", key));
    return node && node->is_array_of_tables() ? node->as_array() : nullptr;
}

void TomlKeys::reject_unknown() {
    for (const auto& [key, node] : table_)
        if (!known_.contains(key.str())) complain(std::string(key.str()), "is not a key of this table: check its spelling");
}

}  // namespace ols
