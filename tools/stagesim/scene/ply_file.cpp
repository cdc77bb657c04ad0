// SPDX-License-Identifier: MIT
// PLY (Greg Turk, "The PLY Polygon File Format", 1994), text and binary of either byte order: vertices, faces, normals, colours.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "scene/numbers.hpp"
#include "scene/polygon_mesh.hpp"

namespace ols {

namespace {

enum class Format { text, little, big };

struct Type {
    int bytes;
    char kind;  // i: signed, u: unsigned, f: floating point
};

const std::map<std::string_view, Type>& types() {
    static const std::map<std::string_view, Type> known = {
        {"char", {1, 'i'}},  {"int8", {1, 'i'}},    {"uchar", {1, 'u'}},  {"uint8", {1, 'u'}},
        {"short", {2, 'i'}}, {"int16", {2, 'i'}},   {"ushort", {2, 'u'}}, {"uint16", {2, 'u'}},
        {"int", {4, 'i'}},   {"int32", {4, 'i'}},   {"uint", {4, 'u'}},   {"uint32", {4, 'u'}},
        {"float", {4, 'f'}}, {"float32", {4, 'f'}}, {"double", {8, 'f'}}, {"float64", {8, 'f'}}};
    return known;
}

struct Property {
    std::string name;
    Type type;
    bool is_list = false;
    Type count{};  // of a list
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
};

struct Header {
    Format format = Format::text;
    std::vector<Element> elements;
    size_t end = 0;  // where the data begin
    uint32_t lines = 0;
};

// Values of the data, one after the other.
class Values {
  public:
    Values(const std::string& path, std::string_view data, Format format) : path_(path), data_(data), format_(format) {}

    // How many values there can still be, at most, of so many bytes each if they are binary.
    uint64_t most(int bytes) const {
        const uint64_t left = data_.size() - at_;
        return format_ == Format::text ? (left + 1) / 2 : left / uint64_t(bytes);
    }

    Result<double> next(Type type) {
        const auto value = format_ == Format::text ? next_word() : next_bytes(type);
        if (!value) return value;
        const double largest = type.kind == 'f' ? coordinate_max : std::ldexp(1.0, 8 * type.bytes - (type.kind == 'i'));
        const bool is_whole = type.kind == 'f' || *value == std::floor(*value);
        if (!(std::abs(*value) <= largest) || !is_whole || (type.kind == 'u' && *value < 0))
            return fail(fmt::format("'{}': byte {}: a value is no number that its property can have", path_, at_));
        return value;
    }

    // Passes over so many values, whatever they are.
    Status skip(Type type, uint64_t count) {
        if (format_ != Format::text) {
            if (count > (data_.size() - at_) / size_t(type.bytes)) return cut_off();
            at_ += size_t(type.bytes) * count;
            return Done{};
        }
        for (uint64_t i = 0; i < count; ++i)
            if (word().empty()) return cut_off();
        return Done{};
    }

    // The bytes behind, but for blanks at the end of a text.
    size_t left() {
        if (format_ == Format::text) at_ = std::min(data_.find_first_not_of(blanks, at_), data_.size());
        return data_.size() - at_;
    }

  private:
    static constexpr const char* blanks = " \t\r\n\v\f";

    Error cut_off() const { return fail("'" + path_ + "' is cut off: its header says more data than the file has"); }

    std::string_view word() {
        const size_t begin = std::min(data_.find_first_not_of(blanks, at_), data_.size());
        at_ = std::min(data_.find_first_of(blanks, begin), data_.size());
        return data_.substr(begin, at_ - begin);
    }

    Result<double> next_word() {
        const std::string_view text = word();
        if (text.empty()) return cut_off();
        const auto value = decimal_number(text);
        if (!value) return fail(fmt::format("'{}': '{:.30}' is no number", path_, text));
        return *value;
    }

    template <typename T>
    double from_bytes(const char* bytes) const {
        std::array<char, sizeof(T)> copy;
        std::copy_n(bytes, sizeof(T), copy.begin());
        if ((format_ == Format::big) != (std::endian::native == std::endian::big))
            std::reverse(copy.begin(), copy.end());
        return double(std::bit_cast<T>(copy));
    }

    Result<double> next_bytes(Type type) {
        if (data_.size() - at_ < size_t(type.bytes)) return cut_off();
        const char* bytes = data_.data() + at_;
        at_ += size_t(type.bytes);
        switch (type.bytes * (type.kind == 'f' ? 10 : type.kind == 'u' ? -1 : 1)) {
            case 1: return from_bytes<int8_t>(bytes);
            case -1: return from_bytes<uint8_t>(bytes);
            case 2: return from_bytes<int16_t>(bytes);
            case -2: return from_bytes<uint16_t>(bytes);
            case 4: return from_bytes<int32_t>(bytes);
            case -4: return from_bytes<uint32_t>(bytes);
            case 40: return from_bytes<float>(bytes);
            default: return from_bytes<double>(bytes);
        }
    }

    const std::string& path_;
    std::string_view data_;
    Format format_;
    size_t at_ = 0;
};

class PlyParser {
  public:
    PlyParser(const std::string& path, const std::string& bytes) : bytes_(bytes) { mesh_.path = path; }

    Result<PolygonMesh> parse() {
        if (const Status status = read_header(); !status) return status.error();
        Values values(mesh_.path, std::string_view(bytes_).substr(header_.end), header_.format);
        for (const Element& element : header_.elements)
            if (const Status status = read_element(element, values); !status) return status.error();
        if (mesh_.positions.empty()) return wrong("has no element `vertex` with x, y and z");
        if (const size_t left = values.left(); left > 0)
            mesh_.notes.push_back(fmt::format("not used: {} bytes after its last element", left));
        if (mesh_.normals.empty())
            for (PolygonMesh::Corner& corner : mesh_.corners) corner.normal = PolygonMesh::none;
        if (const Status status = check_corners(mesh_); !status) return status.error();
        return std::move(mesh_);
    }

  private:
    Error wrong(const std::string& what) const { return fail("'" + mesh_.path + "' " + what); }
    Error bad_line(std::string_view line) const {
        return fail(fmt::format("{}:{}: '{:.60}' is no line of a PLY header", mesh_.path, header_.lines, line));
    }

    Status read_header() {
        for (;;) {
            const size_t end = bytes_.find_first_of("\r\n", header_.end);
            if (end == bytes_.npos) return wrong("has no end of its header (end_header)");
            const std::string_view line = std::string_view(bytes_).substr(header_.end, end - header_.end);
            header_.end = end + (bytes_.compare(end, 2, "\r\n") == 0 ? 2 : 1);
            ++header_.lines;
            const auto words = words_of(line);
            if (words.empty() || words[0] == "ply" || words[0] == "obj_info") continue;
            if (words[0] == "comment") {
                if (words.size() > 1 && words[1] == "TextureFile") mesh_.notes.push_back("not used: its texture");
                continue;
            }
            if (words[0] == "end_header" && !has_format_) return wrong("has no line `format` in its header");
            if (words[0] == "end_header") return Done{};
            if (const Status status = header_line(words, line); !status) return status;
        }
    }

    Status header_line(const std::vector<std::string_view>& words, std::string_view line) {
        const std::map<std::string_view, Format> formats = {
            {"ascii", Format::text}, {"binary_little_endian", Format::little}, {"binary_big_endian", Format::big}};
        if (words[0] == "format" && words.size() == 3 && formats.contains(words[1]) && words[2] == "1.0") {
            header_.format = formats.at(words[1]);
            has_format_ = true;
        } else if (words[0] == "element" && words.size() == 3) {
            const auto count = whole_number(words[2]);
            if (!count || *count < 0) return bad_line(line);
            header_.elements.push_back({std::string(words[1]), uint64_t(*count), {}});
        } else if (words[0] == "property" && !header_.elements.empty()) {
            return header_property(words, line);
        } else {
            return bad_line(line);
        }
        return Done{};
    }

    Status header_property(const std::vector<std::string_view>& words, std::string_view line) {
        const bool is_list = words.size() == 5 && words[1] == "list";
        if (!is_list && words.size() != 3) return bad_line(line);
        const auto type = types().find(words[is_list ? 3 : 1]), count = types().find(words[is_list ? 2 : 1]);
        if (type == types().end() || count == types().end() || (is_list && count->second.kind == 'f'))
            return bad_line(line);
        for (const Property& other : header_.elements.back().properties)
            if (other.name == words.back()) return bad_line(line);
        header_.elements.back().properties.push_back({std::string(words.back()), type->second, is_list, count->second});
        return Done{};
    }

    Status read_element(const Element& element, Values& values) {
        if (element.properties.empty()) return Done{};  // nothing stands in the file for it
        int bytes = 0;
        for (const Property& property : element.properties)
            bytes += property.is_list ? property.count.bytes : property.type.bytes;
        if (element.count > values.most(bytes) / (header_.format == Format::text ? element.properties.size() : 1))
            return wrong(fmt::format("says {} times {} and is too short for it: it is cut off, or damaged",
                                     element.count, element.name));
        if (element.name == "vertex") return read_vertices(element, values);
        if (element.name == "face") return read_faces(element, values);
        if (element.name == "tristrips") return wrong("has triangle strips (tristrips): export it with faces");
        mesh_.notes.push_back(fmt::format("not used: {} times {}", element.count, element.name));
        for (uint64_t i = 0; i < element.count; ++i)
            for (const Property& property : element.properties)
                if (const Status skipped = skip(property, values); !skipped) return skipped;
        return Done{};
    }

    // How many values follow: one, or as many as the list says.
    Result<uint64_t> count_of(const Property& property, Values& values) const {
        if (!property.is_list) return uint64_t(1);
        const auto stated = values.next(property.count);
        if (!stated) return stated.error();
        if (*stated < 0 || *stated > double(values.most(property.type.bytes)))
            return wrong(fmt::format("has a list `{}` that is longer than the file", property.name));
        return uint64_t(*stated);
    }

    Status skip(const Property& property, Values& values) const {
        const auto count = count_of(property, values);
        return count ? values.skip(property.type, *count) : Status(count.error());
    }

    void note_unused(const Element& element, const std::vector<bool>& used) {
        std::string names;
        for (size_t p = 0; p < used.size(); ++p)
            if (!used[p]) names += (names.empty() ? "" : ", ") + element.properties[p].name;
        if (!names.empty()) mesh_.notes.push_back(fmt::format("not used: {} of {}", names, element.name));
    }

    // Where in `properties` each name stands; nothing unless all three do, as single values.
    using Triple = std::array<size_t, 3>;
    static bool find_triple(const Element& element, const std::array<const char*, 3>& names, Triple& triple) {
        for (size_t n = 0; n < 3; ++n) {
            const auto found = std::find_if(element.properties.begin(), element.properties.end(),
                                            [&](const Property& p) { return p.name == names[n] && !p.is_list; });
            if (found == element.properties.end()) return false;
            triple[n] = size_t(found - element.properties.begin());
        }
        return true;
    }

    Status read_vertices(const Element& element, Values& values) {
        if (!mesh_.positions.empty()) return wrong("has two elements `vertex`");
        Triple xyz{}, normal{}, color{};
        if (!find_triple(element, {"x", "y", "z"}, xyz)) return wrong("has vertices without x, y and z");
        const bool has_normals = find_triple(element, {"nx", "ny", "nz"}, normal);
        const bool has_colors = find_triple(element, {"red", "green", "blue"}, color) ||
                                find_triple(element, {"diffuse_red", "diffuse_green", "diffuse_blue"}, color);
        std::vector<bool> used(element.properties.size());
        for (size_t n = 0; n < 3; ++n) {
            used[xyz[n]] = true;
            if (has_normals) used[normal[n]] = true;
            if (has_colors) used[color[n]] = true;
        }
        note_unused(element, used);
        // Whole numbers are shares of their type's largest.
        const auto share = [&](double value, size_t p) {
            const Type type = element.properties[p].type;
            return float(type.kind == 'f' ? value : value / (std::ldexp(1.0, 8 * type.bytes - (type.kind == 'i')) - 1));
        };
        std::vector<double> row(element.properties.size());
        for (uint64_t i = 0; i < element.count; ++i) {
            for (size_t p = 0; p < row.size(); ++p) {
                if (!used[p]) {
                    if (const Status skipped = skip(element.properties[p], values); !skipped) return skipped;
                    continue;
                }
                const auto value = values.next(element.properties[p].type);
                if (!value) return value.error();
                row[p] = *value;
            }
            mesh_.positions.push_back({row[xyz[0]], row[xyz[1]], row[xyz[2]]});
            if (has_normals) mesh_.normals.push_back({row[normal[0]], row[normal[1]], row[normal[2]]});
            if (has_colors)
                mesh_.colors.push_back(
                    {share(row[color[0]], color[0]), share(row[color[1]], color[1]), share(row[color[2]], color[2])});
        }
        return Done{};
    }

    Status read_faces(const Element& element, Values& values) {
        if (!mesh_.polygons.empty()) return wrong("has two elements `face`");
        const auto indices = std::find_if(element.properties.begin(), element.properties.end(), [](const Property& p) {
            return p.is_list && p.type.kind != 'f' && (p.name == "vertex_indices" || p.name == "vertex_index");
        });
        if (indices == element.properties.end())
            return wrong("has faces without a list `vertex_indices` of whole numbers");
        std::vector<bool> used(element.properties.size());
        used[size_t(indices - element.properties.begin())] = true;
        note_unused(element, used);
        mesh_.groups = {"default"};
        for (uint64_t i = 0; i < element.count; ++i)
            for (size_t p = 0; p < used.size(); ++p) {
                const Status status = used[p] ? read_face(element.properties[p], values, uint32_t(i))
                                              : skip(element.properties[p], values);
                if (!status) return status;
            }
        return Done{};
    }

    Status read_face(const Property& property, Values& values, uint32_t number) {
        const auto count = count_of(property, values);
        if (!count) return count.error();
        if (*count < 3) return mesh_.error_at(number, fmt::format("has {} corners: a face has 3 or more", *count));
        mesh_.polygons.push_back({uint32_t(mesh_.corners.size()), uint32_t(*count), 0, number});
        for (uint64_t i = 0; i < *count; ++i) {
            const auto index = values.next(property.type);
            if (!index) return index.error();
            if (*index < 0 || *index >= double(PolygonMesh::none))
                return mesh_.error_at(number, fmt::format("names vertex {}", *index));
            mesh_.corners.push_back({uint32_t(*index), uint32_t(*index)});
        }
        return Done{};
    }

    const std::string& bytes_;
    Header header_;
    bool has_format_ = false;
    PolygonMesh mesh_;
};

}  // namespace

Result<PolygonMesh> parse_ply(const std::string& path, const std::string& bytes) {
    return PlyParser(path, bytes).parse();
}

}  // namespace ols
