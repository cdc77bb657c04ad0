// SPDX-License-Identifier: MIT
// Wavefront OBJ ("Object Files", Wavefront Advanced Visualizer manual, appendix B1): its polygons. Numbers are read in double
// precision, which the importers at hand do not do (docs/doors/meshes.md).
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "scene/numbers.hpp"
#include "scene/polygon_mesh.hpp"

namespace ols {

namespace {

using Words = std::vector<std::string_view>;

// What the statements that have no part in a mesh here are called.
const std::map<std::string_view, const char*>& unused_statements() {
    static const std::map<std::string_view, const char*> names = [] {
        std::map<std::string_view, const char*> made = {
            {"vt", "texture coordinates"},
            {"usemtl", "materials (usemtl): name them by group in the scene"},
            {"mtllib", "material files"},
            {"s", "smoothing groups"},
            {"l", "lines"},
            {"p", "points"},
            {"mg", "merging groups"}};
        for (const char* word : {"vp", "cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole",
                                 "scrv", "sp", "end", "con"})
            made[word] = "free-form curves and surfaces";
        for (const char* word : {"bevel", "c_interp", "d_interp", "lod", "usemap", "maplib", "shadow_obj", "trace_obj",
                                 "ctech", "stech", "call", "csh"})
            made[word] = "attributes of display";
        return made;
    }();
    return names;
}

bool names_something(std::string_view statement) {
    return statement == "g" || statement == "o" || statement == "usemtl" || statement == "mtllib";
}

// The line without a comment, which a # at its begin or after a blank begins, and without blanks around it.
std::string_view without_comment(std::string_view line) {
    for (size_t at = line.find('#'); at != line.npos; at = line.find('#', at + 1))
        if (at == 0 || line[at - 1] == ' ' || line[at - 1] == '\t') {
            line = line.substr(0, at);
            break;
        }
    const size_t begin = line.find_first_not_of(" \t\v\f");
    return begin == line.npos ? std::string_view() : line.substr(begin, line.find_last_not_of(" \t\v\f") + 1 - begin);
}

class ObjParser {
  public:
    explicit ObjParser(const std::string& path) {
        mesh_.path = path;
        mesh_.is_text = true;
    }

    // One statement. The error says what is wrong with it.
    Status statement(std::string_view line, uint32_t number) {
        number_ = number;
        const Words words = words_of(line);
        if (words[0] == "v") return position(words);
        if (words[0] == "vn") return normal(words);
        if (words[0] == "f" || words[0] == "fo") return face(words);
        if (words[0] == "g" || words[0] == "o") return group(line);
        const auto unused = unused_statements().find(words[0]);
        if (unused == unused_statements().end())
            return wrong(fmt::format("'{:.20}' is no statement of an OBJ file", words[0]));
        ++unused_[unused->second];
        return Done{};
    }

    Result<PolygonMesh> take() {
        for (const auto& [what, count] : unused_) mesh_.notes.push_back(fmt::format("not used: {} {}", count, what));
        if (weights_ > 0)
            mesh_.notes.push_back(fmt::format("not used: the fourth number, a weight, of {} vertices", weights_));
        if (!mesh_.colors.empty() && colored_ < mesh_.positions.size())
            mesh_.notes.push_back(fmt::format("{} of {} vertices have colours: those of the others are 0", colored_,
                                              mesh_.positions.size()));
        if (!mesh_.colors.empty()) mesh_.colors.resize(mesh_.positions.size());
        return std::move(mesh_);
    }

  private:
    Error wrong(const std::string& what) const { return mesh_.error_at(number_, what); }

    // `count` numbers after the statement's name.
    Result<std::vector<double>> numbers(const Words& words) const {
        std::vector<double> values;
        for (size_t i = 1; i < words.size(); ++i) {
            const auto value = decimal_number(words[i]);
            if (!value || std::abs(*value) > coordinate_max)
                return wrong(
                    fmt::format("'{:.30}' is no number up to {:g} (decimals have a point)", words[i], coordinate_max));
            values.push_back(*value);
        }
        return values;
    }

    Status position(const Words& words) {
        const auto v = numbers(words);
        if (!v) return v.error();
        if (v->size() != 3 && v->size() != 4 && v->size() != 6)
            return wrong(
                fmt::format("a vertex has 3 numbers, 4 with a weight or 6 with a colour, and not {}", v->size()));
        mesh_.positions.push_back({(*v)[0], (*v)[1], (*v)[2]});
        weights_ += v->size() == 4 && (*v)[3] != 1;
        if (v->size() != 6) return Done{};
        mesh_.colors.resize(mesh_.positions.size());
        mesh_.colors.back() = {float((*v)[3]), float((*v)[4]), float((*v)[5])};
        ++colored_;
        return Done{};
    }

    Status normal(const Words& words) {
        const auto n = numbers(words);
        if (!n) return n.error();
        if (n->size() != 3) return wrong(fmt::format("a normal has 3 numbers, and not {}", n->size()));
        mesh_.normals.push_back({(*n)[0], (*n)[1], (*n)[2]});
        return Done{};
    }

    Status group(std::string_view line) {
        const size_t name = line.find_first_not_of(" \t", line.find_first_of(" \t"));
        select_group(name == line.npos ? "default" : std::string(line.substr(name)));
        return Done{};
    }

    void select_group(const std::string& name) {
        const auto [entry, is_new] = groups_.try_emplace(name, uint32_t(mesh_.groups.size()));
        if (is_new) mesh_.groups.push_back(name);
        group_ = entry->second;
    }

    // What an index stands for: counted from 1, or back from the last one if negative. Whether it exists is known at the end.
    Result<uint32_t> place(std::string_view word, size_t count) const {
        const auto index = whole_number(word);
        if (!index) return wrong(fmt::format("'{:.30}' is no index", word));
        if (*index == 0) return wrong("index 0: indices count from 1, or back from -1");
        if (*index < -int64_t(count))
            return wrong(fmt::format("index {} goes back beyond the first of {}", *index, count));
        if (*index >= int64_t(PolygonMesh::none)) return wrong(fmt::format("index {} is beyond any mesh", *index));
        return uint32_t(*index < 0 ? int64_t(count) + *index : *index - 1);
    }

    // `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    Status corner(std::string_view word) {
        const size_t first = word.find('/');
        const auto position = place(word.substr(0, first), mesh_.positions.size());
        if (!position) return position.error();
        mesh_.corners.push_back({*position});
        if (first == word.npos) return Done{};
        word.remove_prefix(first + 1);
        const size_t second = word.find('/');
        const std::string_view texture = word.substr(0, second);
        if (!texture.empty() && !whole_number(texture)) return wrong(fmt::format("'{:.30}' is no index", texture));
        if (second == word.npos || second + 1 == word.size()) return Done{};
        const auto normal = place(word.substr(second + 1), mesh_.normals.size());
        if (!normal) return normal.error();
        mesh_.corners.back().normal = *normal;
        return Done{};
    }

    Status face(const Words& words) {
        if (words.size() < 4) return wrong(fmt::format("a face has 3 corners or more, and not {}", words.size() - 1));
        if (group_ == PolygonMesh::none) select_group("default");
        const uint32_t first = uint32_t(mesh_.corners.size());
        for (size_t i = 1; i < words.size(); ++i)
            if (const Status status = corner(words[i]); !status) return status;
        mesh_.polygons.push_back({first, uint32_t(words.size() - 1), group_, number_});
        return Done{};
    }

    PolygonMesh mesh_;
    uint32_t number_ = 0, group_ = PolygonMesh::none;
    std::map<std::string, uint32_t> groups_;
    std::map<std::string_view, size_t> unused_;
    size_t weights_ = 0, colored_ = 0;
};

// Statements of a text: lines end in \n, \r\n or \r; a backslash at the end of one that holds no name joins it to the next.
class Statements {
  public:
    explicit Statements(std::string_view text) : text_(text) {}

    // The next one that is not empty; false at the end. `number` is the line it begins on.
    bool next(std::string_view& statement, uint32_t& number) {
        while (begin_ < text_.size()) {
            number = line_ + 1;
            statement = without_comment(line());
            if (statement.empty()) continue;
            if (statement.ends_with('\\') && !names_something(words_of(statement)[0])) statement = joined(statement);
            if (!statement.empty()) return true;
        }
        return false;
    }

  private:
    std::string_view line() {
        const size_t end = std::min(text_.find_first_of("\r\n", begin_), text_.size());
        const std::string_view line = text_.substr(begin_, end - begin_);
        begin_ = end + (text_.substr(end, 2) == "\r\n" ? 2 : 1);
        ++line_;
        return line;
    }

    std::string_view joined(std::string_view first) {
        joined_ = first;
        while (joined_.ends_with('\\') && begin_ < text_.size()) {
            joined_.back() = ' ';
            joined_ += without_comment(line());
        }
        if (joined_.ends_with('\\')) joined_.pop_back();
        return without_comment(joined_);
    }

    std::string_view text_;
    std::string joined_;
    size_t begin_ = 0;
    uint32_t line_ = 0;
};

}  // namespace

Result<PolygonMesh> parse_obj(const std::string& path, std::string bytes) {
    if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff"))
        return fail("'" + path + "' is UTF-16 text: save it as UTF-8");
    if (const size_t zero = bytes.find('\0'); zero != bytes.npos)
        return fail(fmt::format("'{}' holds a zero byte at {}: it is no text, or damaged", path, zero));
    std::string_view text = bytes;
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
    ObjParser parser(path);
    Statements statements(text);
    std::string_view statement;
    for (uint32_t number = 0; statements.next(statement, number);)
        if (const Status status = parser.statement(statement, number); !status) return status.error();
    auto mesh = parser.take();
    if (const Status status = check_corners(*mesh); !status) return status.error();
    return mesh;
}

}  // namespace ols
