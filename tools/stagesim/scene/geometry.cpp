// SPDX-License-Identifier: MIT
// Meshes become Embree triangles at their place of the moment, spheres stay exact spheres.
#include "scene/geometry.hpp"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cassert>
#include <cstring>

namespace ols {

namespace {

RTCGeometry mesh_geometry(RTCDevice device, const Mesh& mesh) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Float3),
                            mesh.positions.size());
    auto* triangles = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), mesh.triangles.size()));
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
        std::memcpy(triangles + 3 * i, mesh.triangles[i].vertex.data(), 3 * sizeof(uint32_t));
    return geometry;
}

RTCGeometry sphere_geometry(RTCDevice device) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), 1);
    return geometry;
}

template <typename T>
T interpolate(const std::vector<T>& values, const Triangle& triangle, float u, float v) {
    return values[triangle.vertex[0]] * (1 - u - v) + values[triangle.vertex[1]] * u + values[triangle.vertex[2]] * v;
}

// An object as it stands now.
struct Placed {
    Placement placement;
    // Of a mesh whose face is not neutral, before the pose; else empty.
    std::vector<Float3> positions, normals;
    RTCGeometry geometry;  // the scene's

    const std::vector<Float3>& positions_of(const Mesh& mesh) const {
        return positions.empty() ? mesh.positions : positions;
    }
    const std::vector<Float3>& normals_of(const Mesh& mesh) const { return normals.empty() ? mesh.normals : normals; }
};

}  // namespace

struct Geometry::State {
    const Scene* scene;
    std::vector<Placed> placed;
    RTCDevice device;
    RTCScene embree;

    ~State() {
        rtcReleaseScene(embree);
        rtcReleaseDevice(device);
    }
    void add(unsigned id);
    void place(unsigned id, const Placement& placement);
};

void Geometry::State::add(unsigned id) {
    const Object& object = scene->objects[id];
    const Mesh* mesh = std::get_if<Mesh>(&object.shape);
    RTCGeometry geometry = mesh ? mesh_geometry(device, *mesh) : sphere_geometry(device);
    placed[id].geometry = geometry;
    rtcAttachGeometryByID(embree, geometry, id);
    rtcReleaseGeometry(geometry);
    // What moves gets its hierarchy once, at rest, and then only new bounds: a hit does not depend on where it was
    // before.
    if (mesh && moves(object)) rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_REFIT);
    place(id,
          moves(object) ? Placement{{}, std::vector<double>(object.expressions.size(), 0)} : placement_at(object, 0));
}

void Geometry::State::place(unsigned id, const Placement& placement) {
    const Object& object = scene->objects[id];
    Placed& now = placed[id];
    now.placement = placement;
    void* buffer = rtcGetGeometryBufferData(now.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    if (const Mesh* mesh = std::get_if<Mesh>(&object.shape)) {
        if (!object.expressions.empty()) {
            now.positions = deformed_positions(*mesh, object.expressions, placement.weights);
            now.normals = smooth_normals(now.positions, mesh->triangles);
        }
        auto* vertices = static_cast<Float3*>(buffer);
        for (const Float3 p : now.positions_of(*mesh)) *vertices++ = placement.pose.point(p);
    } else {
        const Sphere& sphere = std::get<Sphere>(object.shape);
        const Float3 center = placement.pose.point(sphere.center_m);
        auto* point = static_cast<float*>(buffer);
        point[0] = center.x, point[1] = center.y, point[2] = center.z, point[3] = sphere.radius_m;
    }
    rtcUpdateGeometryBuffer(now.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(now.geometry);
}

Geometry::Geometry(const Scene& scene, double time_us) : state_(std::make_unique<State>()) {
    state_->scene = &scene;
    state_->device = rtcNewDevice(nullptr);
    assert(state_->device);
    state_->embree = rtcNewScene(state_->device);
    const bool moving =
        std::any_of(scene.objects.begin(), scene.objects.end(), [](const Object& o) { return moves(o); });
    // Robust: no ray slips through the edge between two triangles.
    rtcSetSceneFlags(state_->embree,
                     moving ? RTCSceneFlags(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC) : RTC_SCENE_FLAG_ROBUST);
    // A hierarchy of one hierarchy an object, so that one may move: that is what Embree makes of "low" quality, which
    // is said of the scene. The objects have their own, which stays "medium".
    if (moving) rtcSetSceneBuildQuality(state_->embree, RTC_BUILD_QUALITY_LOW);
    state_->placed.resize(scene.objects.size());
    for (unsigned i = 0; i < scene.objects.size(); ++i) state_->add(i);
    rtcCommitScene(state_->embree);
    place(time_us);
}

Geometry::~Geometry() = default;
Geometry::Geometry(Geometry&&) noexcept = default;
Geometry& Geometry::operator=(Geometry&&) noexcept = default;

bool Geometry::place(double time_us) {
    bool moved = false;
    for (unsigned i = 0; i < state_->placed.size(); ++i) {
        const Placement placement = placement_at(state_->scene->objects[i], time_us);
        if (placement == state_->placed[i].placement) continue;
        state_->place(i, placement);
        moved = true;
    }
    if (moved) rtcCommitScene(state_->embree);
    return moved;
}

std::array<Float3, 2> Geometry::bounds() const {
    RTCBounds box;
    rtcGetSceneBounds(state_->embree, &box);
    return {Float3{box.lower_x, box.lower_y, box.lower_z}, Float3{box.upper_x, box.upper_y, box.upper_z}};
}

Float3 Geometry::position_of(const SurfaceHit& hit) const {
    const Object& object = state_->scene->objects[hit.object];
    const Placed& now = state_->placed[hit.object];
    if (const Mesh* mesh = std::get_if<Mesh>(&object.shape))
        return now.placement.pose.point(
            interpolate(now.positions_of(*mesh), mesh->triangles[hit.triangle], hit.u, hit.v));
    return now.placement.pose.point(hit.rest_position);
}

std::optional<SurfaceHit> Geometry::intersect(Float3 origin, Float3 direction) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit ray{};
    ray.ray = {origin.x, origin.y, origin.z, 0, direction.x, direction.y, direction.z, 0, INFINITY, ~0u, 0, 0};
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(state_->embree, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

    const Object& object = state_->scene->objects[ray.hit.geomID];
    SurfaceHit hit;
    hit.object = ray.hit.geomID;
    const Placed& now = state_->placed[hit.object];
    hit.pose = now.placement.pose;
    uint32_t group = 0;
    if (const Mesh* mesh = std::get_if<Mesh>(&object.shape)) {
        const Triangle& triangle = mesh->triangles[ray.hit.primID];
        group = triangle.group;
        hit.rest_position = interpolate(mesh->positions, triangle, ray.hit.u, ray.hit.v);
        hit.rest_normal = normalized(interpolate(now.normals_of(*mesh), triangle, ray.hit.u, ray.hit.v));
        hit.mask = interpolate(mesh->masks, triangle, ray.hit.u, ray.hit.v);
        hit.triangle = ray.hit.primID, hit.u = ray.hit.u, hit.v = ray.hit.v;
        hit.position = position_of(hit);
        hit.normal = hit.pose.turn(hit.rest_normal);
    } else {
        const Sphere& sphere = std::get<Sphere>(object.shape);
        const Float3 center = hit.pose.point(sphere.center_m);
        hit.normal = normalized(origin + direction * ray.ray.tfar - center);
        hit.position = center + hit.normal * sphere.radius_m;
        // The texture of a sphere turns with it: undo the rotation.
        const Quaternion q = hit.pose.rotation;
        hit.rest_normal = Pose{{q[0], -q[1], -q[2], -q[3]}, {}}.turn(hit.normal);
        hit.rest_position = sphere.center_m + hit.rest_normal * sphere.radius_m;
    }
    hit.material = object.material_of_group[group];
    return hit;
}

void Geometry::occlude(const RayPacket& rays, std::array<bool, packet_size>& clear) const {
    RTCIntersectContext context;
    // Not marked as coherent: the rays of a packet start on a rough surface, where each meets other boxes, and packets that are
    // followed together take 15 % longer.
    rtcInitIntersectContext(&context);
    RTCRay8 packet;
    std::memcpy(packet.org_x, rays.origin[0], sizeof packet.org_x);
    std::memcpy(packet.org_y, rays.origin[1], sizeof packet.org_y);
    std::memcpy(packet.org_z, rays.origin[2], sizeof packet.org_z);
    std::memcpy(packet.dir_x, rays.direction[0], sizeof packet.dir_x);
    std::memcpy(packet.dir_y, rays.direction[1], sizeof packet.dir_y);
    std::memcpy(packet.dir_z, rays.direction[2], sizeof packet.dir_z);
    std::memcpy(packet.tfar, rays.length, sizeof packet.tfar);
    for (int i = 0; i < packet_size; ++i) {
        packet.tnear[i] = packet.time[i] = 0;
        packet.mask[i] = ~0u;
        packet.id[i] = packet.flags[i] = 0;
    }
    rtcOccluded8(rays.active, state_->embree, &context, &packet);
    // Embree marks a blocked ray by a negative tfar.
    for (int i = 0; i < packet_size; ++i)
        if (rays.active[i] && packet.tfar[i] < 0) clear[i] = false;
}

}  // namespace ols
