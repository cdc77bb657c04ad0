// SPDX-License-Identifier: MIT
// Meshes become Embree triangles at their pose of the moment, spheres stay exact spheres.
#include "geometry.hpp"

#include <embree3/rtcore.h>

#include <cassert>
#include <cstring>

namespace ols {

namespace {

RTCGeometry mesh_geometry(RTCDevice device, const Mesh& mesh, const Pose& pose) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<Float3*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Float3), mesh.positions.size()));
    for (size_t i = 0; i < mesh.positions.size(); ++i) vertices[i] = pose.point(mesh.positions[i]);
    auto* triangles = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), mesh.triangles.size()));
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
        std::memcpy(triangles + 3 * i, mesh.triangles[i].vertex.data(), 3 * sizeof(uint32_t));
    return geometry;
}

RTCGeometry sphere_geometry(RTCDevice device, const Sphere& sphere, const Pose& pose) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    auto* point = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), 1));
    const Float3 center = pose.point(sphere.center_m);
    point[0] = center.x, point[1] = center.y, point[2] = center.z, point[3] = sphere.radius_m;
    return geometry;
}

template <typename T>
T interpolate(const std::vector<T>& values, const Triangle& triangle, float u, float v) {
    return values[triangle.vertex[0]] * (1 - u - v) + values[triangle.vertex[1]] * u + values[triangle.vertex[2]] * v;
}

}  // namespace

struct Geometry::State {
    const Scene* scene;
    std::vector<Pose> poses;
    RTCDevice device;
    RTCScene embree;

    ~State() {
        rtcReleaseScene(embree);
        rtcReleaseDevice(device);
    }
};

Geometry::Geometry(const Scene& scene, double time_us) : state_(std::make_unique<State>()) {
    state_->scene = &scene;
    state_->device = rtcNewDevice(nullptr);
    assert(state_->device);
    state_->embree = rtcNewScene(state_->device);
    // Robust: no ray slips through the edge between two triangles.
    rtcSetSceneFlags(state_->embree, RTC_SCENE_FLAG_ROBUST);
    for (size_t i = 0; i < scene.objects.size(); ++i) {
        const Object& object = scene.objects[i];
        const Pose pose = pose_at(object.motion, time_us);
        state_->poses.push_back(pose);
        const Mesh* mesh = std::get_if<Mesh>(&object.shape);
        RTCGeometry geometry = mesh ? mesh_geometry(state_->device, *mesh, pose)
                                    : sphere_geometry(state_->device, std::get<Sphere>(object.shape), pose);
        rtcCommitGeometry(geometry);
        rtcAttachGeometryByID(state_->embree, geometry, unsigned(i));
        rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(state_->embree);
}

Geometry::~Geometry() = default;
Geometry::Geometry(Geometry&&) noexcept = default;
Geometry& Geometry::operator=(Geometry&&) noexcept = default;

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
    hit.pose = state_->poses[hit.object];
    uint32_t group = 0;
    if (const Mesh* mesh = std::get_if<Mesh>(&object.shape)) {
        const Triangle& triangle = mesh->triangles[ray.hit.primID];
        group = triangle.group;
        hit.rest_position = interpolate(mesh->positions, triangle, ray.hit.u, ray.hit.v);
        hit.rest_normal = normalized(interpolate(mesh->normals, triangle, ray.hit.u, ray.hit.v));
        hit.mask = interpolate(mesh->masks, triangle, ray.hit.u, ray.hit.v);
        hit.position = hit.pose.point(hit.rest_position);
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
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
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
