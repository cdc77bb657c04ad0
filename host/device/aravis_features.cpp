// SPDX-License-Identifier: MIT
// Aravis' calls with their errors sorted out.
#include "device/aravis_features.hpp"

namespace ols {

bool LibraryError::is_of_link() const {
    if (!error_ || error_->domain != ARV_DEVICE_ERROR) return false;
    return error_->code == ARV_DEVICE_ERROR_TIMEOUT || error_->code == ARV_DEVICE_ERROR_NOT_CONNECTED ||
           error_->code == ARV_DEVICE_ERROR_TRANSFER_ERROR;
}

bool AravisFeatures::took(const LibraryError& error) {
    if (error.is_of_link() && broken_.empty()) broken_ = error.message();
    return !error;
}

ArvGcNode* AravisFeatures::node(const char* name) {
    return has(name) ? arv_device_get_feature(device_, name) : nullptr;
}

bool AravisFeatures::has(const char* name) {
    if (!broken_.empty()) return false;
    LibraryError error;
    const bool is_there = arv_device_is_feature_available(device_, name, error.out());
    return took(error) && is_there;
}

const char* AravisFeatures::first_of(std::initializer_list<const char*> names) {
    for (const char* name : names)
        if (has(name)) return name;
    return nullptr;
}

std::optional<std::string> AravisFeatures::text(const char* name) {
    if (!has(name)) return std::nullopt;
    LibraryError error;
    const char* value = arv_device_get_string_feature_value(device_, name, error.out());
    if (!took(error) || !value) return std::nullopt;
    return value;
}

std::optional<int64_t> AravisFeatures::integer(const char* name) {
    if (!has(name)) return std::nullopt;
    LibraryError error;
    const int64_t value = arv_device_get_integer_feature_value(device_, name, error.out());
    return took(error) ? std::optional(value) : std::nullopt;
}

std::optional<double> AravisFeatures::number(const char* name) {
    if (!ARV_IS_GC_FLOAT(node(name))) {
        const auto whole = integer(name);
        return whole ? std::optional(double(*whole)) : std::nullopt;
    }
    LibraryError error;
    const double value = arv_device_get_float_feature_value(device_, name, error.out());
    return took(error) ? std::optional(value) : std::nullopt;
}

std::optional<bool> AravisFeatures::flag(const char* name) {
    if (!has(name)) return std::nullopt;
    LibraryError error;
    const bool value = arv_device_get_boolean_feature_value(device_, name, error.out());
    return took(error) ? std::optional(value) : std::nullopt;
}

std::optional<std::string> AravisFeatures::words(const char* name) {
    ArvGcNode* found = node(name);
    if (!ARV_IS_GC_FEATURE_NODE(found)) return std::nullopt;
    LibraryError error;
    const char* value = arv_gc_feature_node_get_value_as_string(ARV_GC_FEATURE_NODE(found), error.out());
    if (!took(error) || !value) return std::nullopt;
    return value;
}

std::vector<std::string> AravisFeatures::choices(const char* name) {
    if (!has(name)) return {};
    LibraryError error;
    guint count = 0;
    const char** names =
        arv_device_dup_available_enumeration_feature_values_as_strings(device_, name, &count, error.out());
    const bool is_told = took(error) && names;
    std::vector<std::string> found;
    if (is_told) found.assign(names, names + count);
    g_free(names);
    return found;
}

std::optional<AravisFeatures::Range> AravisFeatures::range(const char* name) {
    if (!has(name)) return std::nullopt;
    LibraryError error;
    Range range{0, 0, 1};
    arv_device_get_integer_feature_bounds(device_, name, &range.least, &range.most, error.out());
    if (!took(error)) return std::nullopt;
    const int64_t step = arv_device_get_integer_feature_increment(device_, name, error.out());
    if (took(error) && step > 0) range.step = step;
    return range;
}

bool AravisFeatures::set(const char* name, const std::string& text) {
    if (!has(name)) return false;
    LibraryError error;
    arv_device_set_string_feature_value(device_, name, text.c_str(), error.out());
    return took(error);
}

bool AravisFeatures::set_integer(const char* name, int64_t value) {
    if (!has(name)) return false;
    LibraryError error;
    arv_device_set_integer_feature_value(device_, name, value, error.out());
    return took(error);
}

bool AravisFeatures::set_number(const char* name, double value) {
    if (!ARV_IS_GC_FLOAT(node(name))) return value == double(int64_t(value)) && set_integer(name, int64_t(value));
    LibraryError error;
    arv_device_set_float_feature_value(device_, name, value, error.out());
    return took(error);
}

bool AravisFeatures::set_flag(const char* name, bool value) {
    if (!has(name)) return false;
    LibraryError error;
    arv_device_set_boolean_feature_value(device_, name, value, error.out());
    return took(error);
}

bool AravisFeatures::set_words(const char* name, const std::string& words) {
    ArvGcNode* found = node(name);
    if (!ARV_IS_GC_FEATURE_NODE(found)) return false;
    LibraryError error;
    arv_gc_feature_node_set_value_from_string(ARV_GC_FEATURE_NODE(found), words.c_str(), error.out());
    return took(error);
}

bool AravisFeatures::execute(const char* name) {
    if (!has(name)) return false;
    LibraryError error;
    arv_device_execute_command(device_, name, error.out());
    return took(error);
}

}  // namespace ols
