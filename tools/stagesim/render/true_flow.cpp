// SPDX-License-Identifier: MIT
// Surface points seen at one moment, found again at another.
#include "render/true_flow.hpp"

#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStdIO.h>
#include <half.h>
#include <tbb/parallel_for.h>

#include <limits>

#include "image/whole_file.hpp"
#include "render/pinhole.hpp"
#include "scene/geometry.hpp"

namespace ols {

namespace {

// How much nearer than a point something must be to hide it: more than the rounding of a ray, less than an eyelash.
constexpr float hidden_m = 2e-4f;

bool is_seen(const Geometry& geometry, const Pinhole& camera, Float3 place) {
    const Float3 way = place - camera.position();
    const auto hit = geometry.intersect(camera.position(), normalized(way));
    return !hit || length(hit->position - camera.position()) > length(way) - hidden_m;
}

}  // namespace

TrueFlow true_flow(const Scene& scene, const CameraConfig& config, double from_us, double to_us) {
    const Pinhole camera(config);
    const int width = config.width, height = config.height;
    TrueFlow result{FlowField(width, height), std::vector<unsigned char>(size_t(width) * size_t(height), 0)};
    std::vector<std::optional<SurfaceHit>> hits(result.visible.size());
    Geometry geometry(scene, from_us);
    tbb::parallel_for(0, height, [&](int y) {
        for (int x = 0; x < width; ++x)
            hits[size_t(y) * size_t(width) + size_t(x)] =
                geometry.intersect(camera.position(), camera.ray(x + 0.5, y + 0.5));
    });
    geometry.place(to_us);
    tbb::parallel_for(0, height, [&](int y) {
        for (int x = 0; x < width; ++x) {
            const size_t i = size_t(y) * size_t(width) + size_t(x);
            if (!hits[i]) {
                result.flow.u[i] = result.flow.v[i] = std::numeric_limits<float>::quiet_NaN();
                continue;
            }
            const Float3 place = geometry.position_of(*hits[i]);
            const auto [from_x, from_y] = camera.project(hits[i]->position);
            const auto [to_x, to_y] = camera.project(place);
            // From the point as it was met, not from the pixel's middle, which single precision misses by up to 0.001 px:
            // what stands still has a flow of zero.
            result.flow.u[i] = float(to_x - from_x);
            result.flow.v[i] = float(to_y - from_y);
            const bool inside = to_x >= 0 && to_x <= width && to_y >= 0 && to_y <= height;
            result.visible[i] = inside && is_seen(geometry, camera, place);
        }
    });
    return result;
}

namespace {

std::string encoded(const TrueFlow& flow, double from_us, double to_us) {
    const int width = flow.flow.width, height = flow.flow.height;
    std::vector<Imf::Header> headers(2, Imf::Header(width, height));
    headers[0].setName("flow");
    headers[1].setName("mask");
    for (Imf::Header& header : headers) {
        header.setType(Imf::SCANLINEIMAGE);
        header.insert("fromUs", Imf::DoubleAttribute(from_us));
        header.insert("toUs", Imf::DoubleAttribute(to_us));
    }
    for (const char* name : {"forward.u", "forward.v"}) headers[0].channels().insert(name, Imf::Channel(Imf::FLOAT));
    headers[1].channels().insert("visible", Imf::Channel(Imf::HALF));

    const auto slice = [&](Imf::PixelType type, const void* data, size_t bytes) {
        return Imf::Slice(type, static_cast<char*>(const_cast<void*>(data)), bytes, bytes * size_t(width));
    };
    Imf::FrameBuffer vectors, mask;
    vectors.insert("forward.u", slice(Imf::FLOAT, flow.flow.u.data(), sizeof(float)));
    vectors.insert("forward.v", slice(Imf::FLOAT, flow.flow.v.data(), sizeof(float)));
    const std::vector<::half> visible(flow.visible.begin(), flow.visible.end());
    mask.insert("visible", slice(Imf::HALF, visible.data(), sizeof(::half)));
    Imf::StdOSStream stream;
    {
        Imf::MultiPartOutputFile file(stream, headers.data(), int(headers.size()));
        Imf::OutputPart flow_part(file, 0), mask_part(file, 1);
        flow_part.setFrameBuffer(vectors);
        flow_part.writePixels(height);
        mask_part.setFrameBuffer(mask);
        mask_part.writePixels(height);
    }  // its end writes the tables of lines
    return stream.str();
}

}  // namespace

Status write_true_flow(const std::string& path, const TrueFlow& flow, double from_us, double to_us) {
    try {
        return write_whole_file(path, encoded(flow, from_us, to_us));
    } catch (const std::exception& e) {
        return fail("cannot write '" + path + "': " + e.what());
    }
}

}  // namespace ols
