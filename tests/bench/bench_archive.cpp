// SPDX-License-Identifier: MIT
// Archives: what halves cost in accuracy, and compression in time.
// links: ols_archive
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "archive/target_file.hpp"
#include "bench.hpp"

using namespace ols;

namespace {

// A smooth reflectance from 1e-4 to 1 with 2 % of noise, as the noise of a camera.
Target noisy_target(int width, int height) {
    Target target;
    target.width = width, target.height = height, target.cfa = Cfa::rggb;
    target.mask.resize(size_t(width) * size_t(height));
    std::mt19937 random(9);
    std::normal_distribution<double> noise(1, 0.02);
    for (int lamp = 0; lamp < sphere_lamp_count; ++lamp) {
        target.lamps.emplace_back();
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                target.lamps.back().push_back(
                    float(noise(random) * std::pow(10, -2 + 2 * std::sin(0.02 * x + 0.1 * lamp) * std::cos(0.03 * y))));
    }
    return target;
}

// The lamps of a target's file, by OpenEXR alone: its first part has a channel a lamp, whose names sort as they are numbered.
std::vector<std::vector<float>> read_lamps(const std::string& path, const Target& head) {
    Imf::MultiPartInputFile file(path.c_str());
    Imf::InputPart part(file, 0);
    std::vector<std::vector<float>> lamps(head.lamps.size(), std::vector<float>(head.mask.size()));
    Imf::FrameBuffer buffer;
    size_t lamp = 0;
    const Imf::ChannelList& channels = part.header().channels();
    for (auto channel = channels.begin(); channel != channels.end(); ++channel)
        buffer.insert(channel.name(), Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(lamps.at(lamp++).data()),
                                                 sizeof(float), sizeof(float) * size_t(head.width)));
    part.setFrameBuffer(buffer);
    part.readPixels(0, head.height - 1);
    return lamps;
}

double rms_relative_percent(const std::vector<std::vector<float>>& stored, const Target& truth) {
    double squares = 0;
    for (size_t i = 0; i < truth.lamps.size(); ++i)
        for (size_t p = 0; p < truth.lamps[i].size(); ++p)
            squares += std::pow(double(stored[i][p]) / truth.lamps[i][p] - 1, 2);
    return 100 * std::sqrt(squares / double(truth.lamps.size() * truth.lamps[0].size()));
}

[[noreturn]] void give_up(const Error& error) {
    std::fprintf(stderr, "bench_archive: %s\n", error.message.c_str());
    std::exit(1);
}

class Files {
  public:
    explicit Files(const Target& target)
        : target_(target),
          path_(std::filesystem::temp_directory_path() / ("bench_archive_" + std::to_string(getpid()))) {}
    ~Files() { std::filesystem::remove(path_); }

    Setting writing(const std::string& name, SampleType type, Compression compression) const {
        TakeInfo info;
        info.lights = named_lamps();
        info.value_unit = "reflectance";
        info.sample_type = type, info.compression = compression;
        const auto write = [this, info] {
            const auto source = [&](int plane, const Box& box, float* out) -> Status {
                const auto& samples = target_.lamps[size_t(plane)];
                for (int y = 0; y < box.height; ++y)
                    std::copy_n(samples.data() + size_t(box.y + y) * size_t(target_.width) + size_t(box.x), box.width,
                                out + size_t(y) * size_t(box.width));
                return Done{};
            };
            Target head = target_;
            head.lamps.clear();
            if (const auto written = write_target_file(path_, info, head, source); !written) give_up(written.error());
        };
        const auto error = [this, write] {
            write();  // another setting may have written last
            return rms_relative_percent(read_lamps(path_, target_), target_);
        };
        return {name, write, error};
    }

  private:
    const Target& target_;
    std::string path_;
};

}  // namespace

int main(int argc, char** argv) {
    Bench bench(
        argc, argv,
        {.name = "archive",
         .truth = "A target of 156 lamps and 320 x 240 mosaic samples from 1e-4 to 1 (r, white = 1) with 2 % "
                  "of noise, written, "
                  "synced and read back; the error is relative, root mean square. The time is the processor's, "
                  "not the disk's.",
         .advice =
             "Halves are as good as the camera: their rounding is a hundredth of its noise, and files are half as "
             "large. "
             "Take `--float` for what is brighter than 65504 or darker than 1e-5 (photographs of a sun, differences). "
             "Compression saves room where the subject does not fill the frame; noise does not compress."});
    const Target target = bench.full() ? noisy_target(320, 240) : noisy_target(32, 24);
    const Files files(target);
    const Setting half = files.writing("half", SampleType::half_float, Compression::none);
    bench.measure({.name = "sample type",
                   .set_by = "`stagectl ingest --float`, `TakeInfo::sample_type`",
                   .error_unit = "% rms",
                   .peer = "float",
                   .default_setting = "half",
                   .why_off_front =
                       "a half target is half as large on the disk (96 MB for 640 x 480, not 192), and the disk is "
                       "what limits a recording; its rounding is far below the camera's noise.",
                   .settings = {half, files.writing("float", SampleType::single_float, Compression::none)}});
    bench.measure({.name = "compression",
                   .set_by = "`stagectl ingest --zips`, `TakeInfo::compression`",
                   .error_unit = "% rms",
                   .peer = "OpenEXR ZIPS",
                   .default_setting = "none",
                   .settings = {{"none", half.run, half.error},
                                files.writing("OpenEXR ZIPS", SampleType::half_float, Compression::zips)}});
    return bench.finish();
}
