// SPDX-License-Identifier: MIT
// glTF 2.0 specification, sections 3.6 (binary data), 4 (GLB) and 5.1 (accessors). Inside, what is wrong is thrown; it is caught
// before it leaves.
#include "scene/gltf_buffers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "image/base64.hpp"
#include "image/input_file.hpp"
#include "scene/polygon_mesh.hpp"

namespace ols {

namespace {

using nlohmann::json;

constexpr uint64_t json_bytes_max = 64 << 20;  // it takes some twenty times as much in memory
constexpr int json_depth_max = 64;

[[noreturn]] void wrong(const std::string& what) {
    throw std::runtime_error(what);
}

json parse_json(std::string_view text) {
    if (text.size() > json_bytes_max) wrong(fmt::format("its JSON has more than {} bytes", json_bytes_max));
    return json::parse(text, [](int depth, json::parse_event_t, json&) {
        if (depth > json_depth_max) wrong("its JSON nests too deep");
        return true;
    });
}

uint32_t word_at(std::string_view bytes, size_t at) {
    if (at + 4 > bytes.size()) wrong("it is cut off");
    uint32_t word = 0;
    for (size_t i = 4; i-- > 0;) word = word << 8 | uint8_t(bytes[at + i]);
    return word;
}

struct Parts {
    std::string_view json, binary;
    bool has_binary = false;
};

Parts split(std::string_view bytes) {
    if (!bytes.starts_with("glTF")) {
        if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
        return {bytes, {}, false};
    }
    if (word_at(bytes, 4) != 2) wrong(fmt::format("it is of version {}, and 2 is read", word_at(bytes, 4)));
    if (word_at(bytes, 8) > bytes.size()) wrong("it is cut off: it says more bytes than it has");
    bytes = bytes.substr(0, word_at(bytes, 8));
    Parts parts;
    for (size_t at = 12; at < bytes.size();) {
        const size_t size = word_at(bytes, at), type = word_at(bytes, at + 4);
        if (size > bytes.size() - at - 8) wrong("a chunk is longer than the file");
        const std::string_view chunk = bytes.substr(at + 8, size);
        if (at == 12) parts.json = chunk;
        if (at == 12 && type != 0x4e4f534a) wrong("its first chunk is not JSON");
        if (at != 12 && type == 0x004e4942 && !parts.has_binary) parts.binary = chunk, parts.has_binary = true;
        at += 8 + size + (4 - size % 4) % 4;
    }
    return parts;
}

std::string without_escapes(std::string_view uri) {
    std::string name;
    for (size_t i = 0; i < uri.size(); ++i) {
        if (uri[i] != '%') {
            name.push_back(uri[i]);
            continue;
        }
        const auto digit = [&](size_t at) {
            const size_t value = at < uri.size()
                                     ? std::string_view("0123456789abcdef").find(char(std::tolower(uri[at])))
                                     : std::string_view::npos;
            return value == std::string_view::npos ? wrong("a URI has a wrong escape"), size_t(0) : value;
        };
        name.push_back(char(digit(i + 1) * 16 + digit(i + 2)));
        i += 2;
    }
    return name;
}

// What a URI names: data, or a file that lies beside the mesh or below.
std::string fetch(const std::string& mesh_path, const std::string& uri) {
    if (uri.starts_with("data:")) {
        const size_t comma = uri.find(',');
        if (comma == uri.npos || !std::string_view(uri).substr(0, comma).ends_with(";base64"))
            wrong("a data: URI is not base64");
        std::string text = uri.substr(comma + 1);
        text.append((4 - text.size() % 4) % 4, '=');  // which some programs leave out
        auto bytes = bytes_of_base64(text);
        if (!bytes) wrong("a data: URI holds something else than base64");
        return std::move(*bytes);
    }
    const std::filesystem::path name(without_escapes(uri));
    const bool climbs = std::any_of(name.begin(), name.end(), [](const auto& part) { return part == ".."; });
    if (name.is_absolute() || climbs || uri.find(':') != uri.npos)
        wrong(fmt::format("its buffer '{:.60}' lies outside of its folder: put it beside", uri));
    auto bytes = read_input((std::filesystem::path(mesh_path).parent_path() / name).string(), "buffer of a mesh",
                            mesh_bytes_max);
    if (!bytes) wrong(bytes.error().message);
    return std::move(*bytes);
}

struct ComponentType {
    int bytes;
    bool is_signed, is_float;
};

ComponentType component_type(uint64_t code) {
    switch (code) {
        case 5120: return {1, true, false};
        case 5121: return {1, false, false};
        case 5122: return {2, true, false};
        case 5123: return {2, false, false};
        case 5125: return {4, false, false};
        case 5126: return {4, true, true};
        default: wrong(fmt::format("an accessor has the component type {}, which there is not", code));
    }
}

double component(const char* bytes, ComponentType type) {
    uint32_t word = 0;
    for (int i = type.bytes; i-- > 0;) word = word << 8 | uint8_t(bytes[i]);
    if (type.is_float) {
        float value;
        std::memcpy(&value, &word, sizeof value);
        return value;
    }
    if (!type.is_signed) return word;
    return type.bytes == 1 ? double(int8_t(word)) : double(int16_t(word));
}

int components_of(const std::string& type) {
    static const std::map<std::string, int> known = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}};
    const auto found = known.find(type);
    return found == known.end() ? 0 : found->second;
}

const json& entry(const json& root, const char* list, uint64_t index) {
    const json& entries = root.at(list);
    if (!entries.is_array() || index >= entries.size()) wrong(fmt::format("there is no {} of {}", index, list));
    return entries[index];
}

}  // namespace

uint64_t gltf_whole(const json& object, const char* key, uint64_t otherwise) {
    const auto found = object.find(key);
    if (found == object.end()) return otherwise;
    if (found->is_number_unsigned()) return found->get<uint64_t>();
    const double value = found->is_number() ? found->get<double>() : -1;
    if (!(value >= 0 && value < 9e15) || value != std::floor(value))
        wrong(fmt::format("{} is no whole number of 0 or more", key));
    return uint64_t(value);
}

Result<GltfBuffers> GltfBuffers::open(const std::string& path, const std::string& bytes) {
    try {
        const Parts parts = split(bytes);
        GltfBuffers made;
        made.json_ = parse_json(parts.json);
        made.bytes_ = bytes.size();
        if (!made.json_.is_object()) wrong("its JSON is no object");
        for (const json& buffer : made.json_.value("buffers", json::array())) {
            const uint64_t length = gltf_whole(buffer, "byteLength", 0);
            const bool is_own = !buffer.contains("uri");
            if (is_own && !(made.buffers_.empty() && parts.has_binary)) wrong("a buffer has no uri and no data");
            made.buffers_.push_back(is_own ? std::string(parts.binary) : fetch(path, buffer.at("uri")));
            if (!is_own) made.bytes_ += made.buffers_.back().size();
            if (made.bytes_ > mesh_bytes_max) wrong(fmt::format("its buffers have more than {} bytes", mesh_bytes_max));
            if (made.buffers_.back().size() < length)
                wrong(fmt::format("a buffer has {} bytes, and should have {}: it is cut off",
                                  made.buffers_.back().size(), length));
        }
        return made;
    } catch (const std::exception& e) {
        return fail(fmt::format("'{}' cannot be read as glTF: {}", path, e.what()));
    }
}

std::vector<double> GltfBuffers::read(uint64_t index, int components) const {
    const json& accessor = entry(json_, "accessors", index);
    if (accessor.contains("sparse")) wrong("an accessor is sparse, which is not read: export it without");
    if (!accessor.contains("bufferView")) wrong("an accessor has no data (bufferView)");
    if (components_of(accessor.at("type")) != components)
        wrong(fmt::format("accessor {} has not the {} components that it should", index, components));
    const ComponentType type = component_type(gltf_whole(accessor, "componentType", 0));
    const json& view = entry(json_, "bufferViews", gltf_whole(accessor, "bufferView", 0));
    const uint64_t buffer_index = gltf_whole(view, "buffer", buffers_.size());
    if (buffer_index >= buffers_.size()) wrong("a bufferView names no buffer that there is");
    const std::string& buffer = buffers_[buffer_index];
    const uint64_t view_begin = gltf_whole(view, "byteOffset", 0), view_bytes = gltf_whole(view, "byteLength", 0);
    if (view_begin > buffer.size() || view_bytes > buffer.size() - view_begin)
        wrong("a bufferView reaches beyond its buffer");
    const uint64_t element = uint64_t(type.bytes) * uint64_t(components);
    const uint64_t stride = gltf_whole(view, "byteStride", element), count = gltf_whole(accessor, "count", 0);
    const uint64_t begin = gltf_whole(accessor, "byteOffset", 0);
    if (stride < element || stride > 252) wrong("a bufferView has a stride that its elements do not fit");
    if (begin > view_bytes ||
        (count > 0 && (view_bytes - begin < element || count - 1 > (view_bytes - begin - element) / stride)))
        wrong(fmt::format("accessor {} has {} elements and reaches beyond its bufferView", index, count));
    const bool is_share = accessor.value("normalized", false) && !type.is_float;
    const double largest = is_share ? std::ldexp(1.0, 8 * type.bytes - type.is_signed) - 1 : 1;
    std::vector<double> values;
    values.reserve(count * uint64_t(components));
    for (uint64_t i = 0; i < count; ++i)
        for (int c = 0; c < components; ++c) {
            const double value =
                component(buffer.data() + view_begin + begin + i * stride + uint64_t(c * type.bytes), type);
            if (!(std::abs(value) <= coordinate_max))
                wrong(fmt::format("accessor {} holds a value that is no number", index));
            values.push_back(is_share ? std::max(-1.0, value / largest) : value);
        }
    return values;
}

}  // namespace ols
