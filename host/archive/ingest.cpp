// SPDX-License-Identifier: MIT
// Ingest: match names, decode in parallel to a spool, write one target.
#include "archive/ingest.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "archive/plane_spool.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

std::string lower_case(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return tolower(c); });
    return text;
}

// What stands after the last slash of either kind.
std::string base_name(const std::string& path) {
    const size_t slash = path.find_last_of("/\\");
    return slash == std::string::npos ? path : path.substr(slash + 1);
}

bool looks_like_a_picture(const std::string& name) {
    static const std::set<std::string> extensions = {".png", ".jpg", ".jpeg", ".tif", ".tiff",
                                                     ".tga", ".exr", ".hdr",  ".bmp", ".webp"};
    return extensions.contains(lower_case(fs::path(name).extension().string()));
}

Result<std::set<std::string>> file_names(const std::string& directory) {
    std::set<std::string> names;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(directory, error))
        if (entry.is_regular_file(error)) names.insert(entry.path().filename().string());
    if (error) return fail("cannot read folder '" + directory + "': " + error.message());
    return names;
}

std::string some_of(const std::vector<std::string>& names) {
    constexpr size_t shown = 5;
    const std::vector<std::string> first(names.begin(), names.begin() + std::ptrdiff_t(std::min(shown, names.size())));
    std::string text = fmt::format("'{}'", fmt::join(first, "', '"));
    if (names.size() > shown) text += fmt::format(" and {} more", names.size() - shown);
    return text;
}

// The path, relative to the folder, of the picture that a light of the .lp file means; empty when there is none. Two
// files that differ in letter case alone are an error, for neither is meant more than the other.
Result<std::string> picture_of(const std::string& light, const fs::path& directory,
                               const std::set<std::string>& files) {
    std::error_code error;
    const fs::path as_written = fs::path(light).lexically_normal();
    if (as_written.is_relative() && !as_written.string().starts_with("..") &&
        fs::is_regular_file(directory / as_written, error))
        return as_written.string();
    const std::string base = base_name(light);
    if (files.contains(base)) return base;
    std::vector<std::string> alike;
    for (const auto& file : files)
        if (lower_case(file) == lower_case(base)) alike.push_back(file);
    if (alike.size() > 1)
        return fail(fmt::format("'{}' may mean {} of '{}': write the name in the .lp file as one of these", base,
                                some_of(alike), directory.string()));
    return alike.empty() ? std::string() : alike.front();
}

Result<std::vector<std::string>> match_pictures(const std::vector<LightPosition>& lights, const std::string& lp,
                                                const std::string& directory) {
    const auto files = file_names(directory);
    if (!files) return files.error();
    std::vector<std::string> pictures, missing;
    std::map<std::string, std::string> meant_by;
    for (const auto& light : lights) {
        const auto picture = picture_of(light.name, directory, *files);
        if (!picture) return picture.error();
        if (picture->empty()) {
            missing.push_back(base_name(light.name));
            continue;
        }
        const auto [other, fresh] = meant_by.try_emplace(*picture, light.name);
        if (!fresh)
            return fail(fmt::format("{}: '{}' and '{}' both mean '{}/{}': every light needs a picture of its own", lp,
                                    other->second, light.name, directory, *picture));
        pictures.push_back(*picture);
    }
    if (!missing.empty())
        return fail(fmt::format("{} of the {} pictures that '{}' names are not in '{}': {}", missing.size(),
                                lights.size(), lp, directory, some_of(missing)));
    return pictures;
}

// Pictures, their planes put aside, and what kind each was.
struct Pictures {
    int width = 0, height = 0;
    std::vector<char> in_color;  // for each picture: three planes at 3 i, else one
    std::vector<char> was_srgb;
    std::optional<PlaneSpool> spool;

    bool any_color() const { return std::find(in_color.begin(), in_color.end(), 1) != in_color.end(); }
    bool all_srgb() const { return std::find(was_srgb.begin(), was_srgb.end(), 0) == was_srgb.end(); }
};

Status put_aside(Pictures& pictures, int index, const Picture& picture, const std::string& path,
                 const std::string& first) {
    const Image& image = picture.light;
    if (image.width != pictures.width || image.height != pictures.height)
        return fail(fmt::format("'{}' is {} x {}, but '{}' is {} x {}: all pictures must be of one size", path,
                                image.width, image.height, first, pictures.width, pictures.height));
    pictures.in_color[index] = image.channels == 3;
    pictures.was_srgb[index] = picture.was_srgb;
    std::vector<float> plane(size_t(image.width) * image.height);
    for (int c = 0; c < image.channels; ++c) {
        for (size_t p = 0; p < plane.size(); ++p) plane[p] = image.data[p * image.channels + c];
        if (auto s = pictures.spool->write(index * 3 + c, plane); !s) return s;
    }
    return Done{};
}

Status check_disk(const fs::path& directory, const Image& first, size_t count, SampleType type) {
    const double samples = double(first.data.size()) * double(count);
    const double needed = samples * (sizeof(float) + (type == SampleType::half_float ? 2 : 4));
    std::error_code error;
    const auto space = fs::space(directory, error);
    if (error || double(space.available) >= needed) return Done{};
    return fail(
        fmt::format("{} pictures of {} x {} need {:.1f} GB of disk while they are ingested, '{}' has {:.1f}: "
                    "free space or choose another disk",
                    count, first.width, first.height, needed / 1e9, directory.string(), double(space.available) / 1e9));
}

Result<Pictures> read_pictures(const std::vector<std::string>& paths, const fs::path& spool_directory,
                               const IngestOptions& options) {
    const auto first = read_picture(paths[0], options.transfer);
    if (!first) return first.error();
    if (auto s = check_disk(spool_directory, first->light, paths.size(), options.sample_type); !s) return s.error();
    auto spool = PlaneSpool::create(spool_directory.string(), first->light.width, first->light.height);
    if (!spool) return spool.error();
    Pictures pictures{first->light.width, first->light.height, std::vector<char>(paths.size()),
                      std::vector<char>(paths.size()), std::move(*spool)};

    // The first error in the order of the .lp file is the one reported, whichever thread met one first.
    std::atomic<int> next{0}, failed{int(paths.size())};
    int done = 0;
    std::mutex reporting;
    std::vector<std::string> errors(paths.size());
    const auto work = [&] {
        for (int i; (i = next++) < int(paths.size()) && i < failed;) {
            const auto picture = read_picture(paths[i], options.transfer);
            const Status kept = picture ? put_aside(pictures, i, *picture, paths[i], paths[0]) : picture.error();
            if (!kept) {
                errors[i] = kept.error().message;
                int lowest = failed;
                while (i < lowest && !failed.compare_exchange_weak(lowest, i)) {
                }
            }
            const std::scoped_lock lock(reporting);
            options.progress(++done, int(paths.size()));
        }
    };
    {
        std::vector<std::jthread> others;
        for (unsigned t = 1; t < std::max(1u, std::thread::hardware_concurrency()); ++t) others.emplace_back(work);
        work();
    }
    if (failed < int(paths.size())) return fail(errors[failed]);
    return pictures;
}

Result<std::vector<uint32_t>> read_mask(const std::string& path, int width, int height) {
    const auto picture = read_picture(path, Transfer::linear);
    if (!picture) return picture.error();
    const Image& image = picture->light;
    if (image.width != width || image.height != height)
        return fail(fmt::format("mask '{}' is {} x {}, the pictures are {} x {}", path, image.width, image.height,
                                width, height));
    std::vector<uint32_t> mask(size_t(width) * height);
    for (size_t p = 0; p < mask.size(); ++p)
        if (!(image.data[p * image.channels] >= 0.5f)) mask[p] = mask_outside;
    return mask;
}

const char* transfer_name(Transfer transfer) {
    return transfer == Transfer::srgb ? "srgb" : transfer == Transfer::linear ? "linear" : "by type";
}

TakeInfo take_info(const IngestOptions& options, const std::vector<LightPosition>& lights, bool srgb) {
    TakeInfo info;
    info.production = options.production;
    info.scene = options.scene;
    info.take = options.take;
    info.notes = options.notes;
    info.value_unit = "pixel";
    info.lights = lights;
    for (auto& light : info.lights) light.name = base_name(light.name);
    info.sample_type = options.sample_type;
    info.compression = options.compression;
    // sRGB pictures have its primaries, which are those of Rec. 709; what is linear already says nothing of its own.
    if (srgb) info.color_interop_id = "lin_rec709_scene";
    info.extra = {{"ingest",
                   {{"folder", fs::path(options.directory).lexically_normal().filename().string()},
                    {"lights", base_name(options.lights)},
                    {"mask", base_name(options.mask)},
                    {"transfer", transfer_name(options.transfer)}}}};
    return info;
}

Status write_archive(const IngestOptions& options, const TakeInfo& info, const Pictures& pictures,
                     std::vector<uint32_t> mask) {
    auto writer = ArchiveWriter::create_beside(options.output, info, options.overwrite);
    if (!writer) return writer.error();
    Target head;
    head.width = pictures.width;
    head.height = pictures.height;
    head.cfa = pictures.any_color() ? Cfa::rgb : Cfa::none;
    head.mask = std::move(mask);
    head.provenance = {{"source", "photographs"}};
    const int planes = head.planes();
    Status written = writer->write_target(head, [&](int plane, const Box& box, float* out) {
        const int lamp = plane / planes, color = pictures.in_color[lamp] ? plane % planes : 0;
        return pictures.spool->read(lamp * 3 + color, box, out);
    });
    return written ? writer->finish() : written;
}

}  // namespace

Result<IngestReport> ingest(const IngestOptions& options) {
    const auto lights = read_lp(options.lights);
    if (!lights) return lights.error();
    const auto names = match_pictures(*lights, options.lights, options.directory);
    if (!names) return names.error();
    std::error_code error;
    if (!options.overwrite && fs::exists(options.output, error))
        return fail("'" + options.output + "' exists: choose another name or overwrite it");
    const fs::path beside = fs::absolute(options.output, error).lexically_normal() / "..";
    if (!fs::is_directory(beside.lexically_normal(), error))
        return fail("the folder of '" + options.output + "' does not exist: make it first");

    std::vector<std::string> paths;
    for (const auto& name : *names) paths.push_back((fs::path(options.directory) / name).string());
    const auto pictures = read_pictures(paths, beside.lexically_normal(), options);
    if (!pictures) return pictures.error();
    std::vector<uint32_t> mask;
    if (!options.mask.empty()) {
        auto read = read_mask(options.mask, pictures->width, pictures->height);
        if (!read) return read.error();
        mask = std::move(*read);
    }
    if (auto s = write_archive(options, take_info(options, *lights, pictures->all_srgb()), *pictures, std::move(mask));
        !s)
        return s.error();

    IngestReport report{int(lights->size()), pictures->width, pictures->height, pictures->any_color(), {}};
    const auto files = file_names(options.directory);
    for (const auto& file : files.ok() ? *files : std::set<std::string>())
        if (looks_like_a_picture(file) && std::find(names->begin(), names->end(), file) == names->end())
            report.unused.push_back(file);
    return report;
}

}  // namespace ols
