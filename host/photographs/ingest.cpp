// SPDX-License-Identifier: MIT
// Ingest: match names, decode in parallel to a spool, write one target.
#include "photographs/ingest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <mutex>
#include <optional>

#include "exceptions.hpp"
#include "photographs/light_intensities.hpp"
#include "photographs/picture_names.hpp"
#include "photographs/plane_spool.hpp"
#include "photographs/set_notes.hpp"
#include "photographs/subject_mask.hpp"
#include "stage/light_file.hpp"
#include "worker_threads.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

// Pictures, their planes put aside, and what kind each was.
struct Pictures {
    int width = 0, height = 0;
    std::vector<char> in_color;       // for each picture: three planes at 3 i, else one
    std::vector<PictureFacts> facts;  // of each
    std::optional<PlaneSpool> spool;

    // All are of one mosaic or of none: check_set() has seen to that.
    Cfa cfa() const {
        const bool any_color = std::ranges::find(in_color, 1) != in_color.end();
        return any_color ? Cfa::rgb : facts.front().cfa;
    }
    bool all_rec709() const {
        return std::ranges::all_of(facts, [](const auto& f) { return f.is_rec709; });
    }
};

// A channel of an image, over how bright its light was.
void divide_channel(const Image& image, int channel, double intensity, std::vector<float>& plane) {
    const float* sample = image.data.data() + channel;
    const float divisor = float(intensity);
    for (float& value : plane) {
        value = *sample / divisor;
        sample += image.channels;
    }
}

// The same for a mosaic, whose pixels see different colours of the light.
void divide_mosaic(const Image& image, Cfa cfa, const Intensity& intensity, std::vector<float>& plane) {
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            plane[size_t(y) * image.width + x] = image.at(x, y) / float(intensity[cfa_color(cfa, x, y)]);
}

Status put_aside(Pictures& pictures, int index, const Picture& picture, const Intensity& intensity,
                 const std::string& path, const std::string& first) {
    const Image& image = picture.light;
    if (image.width != pictures.width || image.height != pictures.height)
        return fail(fmt::format("'{}' is {} x {}, but '{}' is {} x {}: all pictures must be of one size", path,
                                image.width, image.height, first, pictures.width, pictures.height));
    pictures.in_color[index] = image.channels == 3;
    std::vector<float> plane(size_t(image.width) * image.height);
    for (int c = 0; c < image.channels; ++c) {
        if (is_mosaic(picture.cfa))
            divide_mosaic(image, picture.cfa, intensity, plane);
        else
            divide_channel(image, c, image.channels == 1 ? intensity[1] : intensity[c], plane);
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

Result<Pictures> read_pictures(const std::vector<std::string>& paths, const std::vector<Intensity>& intensities,
                               const fs::path& spool_directory, const IngestOptions& options) {
    const auto first = read_picture(paths[0], options.picture);
    if (!first) return first.error();
    if (auto s = check_disk(spool_directory, first->light, paths.size(), options.sample_type); !s) return s.error();
    auto spool = PlaneSpool::create(spool_directory.string(), first->light.width, first->light.height);
    if (!spool) return spool.error();
    Pictures pictures{first->light.width, first->light.height, std::vector<char>(paths.size()),
                      std::vector<PictureFacts>(paths.size()), std::move(*spool)};
    const auto keep = [&](int i, const Picture& picture) {
        pictures.facts[i] = picture;
        return put_aside(pictures, i, picture, intensities[i], paths[i], paths[0]);
    };
    if (auto s = keep(0, *first); !s) return s.error();
    options.progress(1, int(paths.size()));

    // The first error in the order of the .lp file is the one reported, whichever thread met one first.
    std::atomic<int> next{1}, failed{int(paths.size())};
    int done = 1;
    std::mutex reporting;
    std::vector<std::string> errors(paths.size());
    run_workers(thread_count(0), [&](int) {
        for (int i; (i = next++) < int(paths.size()) && i < failed;) {
            const Status kept = guarded("cannot take '" + paths[i] + "'", [&]() -> Status {
                const auto picture = read_picture(paths[i], options.picture);
                return picture ? keep(i, *picture) : picture.error();
            });
            if (!kept) {
                errors[i] = kept.error().message;
                int lowest = failed;
                while (i < lowest && !failed.compare_exchange_weak(lowest, i)) {
                }
            }
            const std::scoped_lock lock(reporting);
            options.progress(++done, int(paths.size()));
        }
    });
    if (failed < int(paths.size())) return fail(errors[failed]);
    return pictures;
}

const char* transfer_name(Transfer transfer) {
    return transfer == Transfer::srgb ? "srgb" : transfer == Transfer::linear ? "linear" : "by file";
}

TakeInfo take_info(const IngestOptions& options, const std::vector<LightPosition>& lights, const Pictures& pictures,
                   const std::vector<std::string>& said) {
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
    if (pictures.all_rec709()) info.color_interop_id = "lin_rec709_scene";
    info.extra = {{"ingest",
                   {{"folder", fs::path(options.directory).lexically_normal().filename().string()},
                    {"lights", base_name(options.lights)},
                    {"mask", base_name(options.mask)},
                    {"intensities", base_name(options.intensities)},
                    {"transfer", transfer_name(options.picture.transfer)},
                    {"full_scale", options.picture.full_scale},
                    {"said", said}}}};
    return info;
}

Status write_archive(const IngestOptions& options, const TakeInfo& info, const Pictures& pictures,
                     std::vector<uint32_t> mask) {
    auto writer = ArchiveWriter::create_beside(options.output, info, options.overwrite);
    if (!writer) return writer.error();
    Target head;
    head.width = pictures.width;
    head.height = pictures.height;
    head.cfa = pictures.cfa();
    head.mask = std::move(mask);
    head.provenance = {{"source", "photographs"}};
    const int planes = head.planes();
    Status written = writer->write_target(head, [&](int plane, const Box& box, float* out) {
        const int lamp = plane / planes, color = pictures.in_color[lamp] ? plane % planes : 0;
        return pictures.spool->read(lamp * 3 + color, box, out);
    });
    return written ? writer->finish() : written;
}

// Of each light, 1 where nothing says otherwise.
Result<std::vector<Intensity>> intensities_of(const LightFile& file, const IngestOptions& options) {
    if (!options.intensities.empty() && !file.intensities.empty())
        return fail("'" + options.lights +
                    "' has intensities of its own: leave out --intensities, or remove them there");
    if (!options.intensities.empty()) return read_light_intensities(options.intensities, file.lights);
    return file.intensities.empty() ? std::vector<Intensity>(file.lights.size(), {1, 1, 1}) : file.intensities;
}

Result<fs::path> folder_of(const IngestOptions& options) {
    std::error_code error;
    if (!options.overwrite && fs::exists(options.output, error))
        return fail("'" + options.output + "' exists: choose another name or overwrite it");
    const fs::path folder = (fs::absolute(options.output, error).lexically_normal() / "..").lexically_normal();
    if (!fs::is_directory(folder, error))
        return fail("the folder of '" + options.output + "' does not exist: make it first");
    return folder;
}

// Pictures of the folder that no light means.
std::vector<std::string> unused_pictures(const std::string& folder, const std::vector<std::string>& names) {
    std::vector<std::string> unused;
    const auto files = file_names(folder);
    for (const auto& file : files.ok() ? *files : std::set<std::string>())
        if (looks_like_a_picture(file) && std::ranges::find(names, file) == names.end()) unused.push_back(file);
    return unused;
}

}  // namespace

Result<IngestReport> ingest(const IngestOptions& options) {
    const auto file = read_light_file(options.lights);
    if (!file) return file.error();
    const auto names = match_pictures(file->lights, options.lights, options.directory);
    if (!names) return names.error();
    const auto intensities = intensities_of(*file, options);
    if (!intensities) return intensities.error();
    const auto folder = folder_of(options);
    if (!folder) return folder.error();

    std::vector<std::string> paths;
    for (const auto& name : *names) paths.push_back((fs::path(options.directory) / name).string());
    const auto pictures = read_pictures(paths, *intensities, *folder, options);
    if (!pictures) return pictures.error();
    auto said = check_set(*names, pictures->facts, options.picture);
    if (!said) return said.error();
    if (!file->intensities.empty())
        said->push_back("each picture is divided by the intensity that stands behind its light's direction");
    SubjectMask mask;
    if (!options.mask.empty()) {
        auto read = read_subject_mask(options.mask, pictures->width, pictures->height, options.picture);
        if (!read) return read.error();
        mask = std::move(*read);
        said->insert(said->end(), mask.said.begin(), mask.said.end());
    }
    const TakeInfo info = take_info(options, file->lights, *pictures, *said);
    if (auto s = write_archive(options, info, *pictures, std::move(mask.bits)); !s) return s.error();
    return IngestReport{int(file->lights.size()), pictures->width, pictures->height,
                        pictures->cfa(),          *said,           unused_pictures(options.directory, *names)};
}

}  // namespace ols
