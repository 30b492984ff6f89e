// SPDX-License-Identifier: Apache-2.0
#include "embree_scene.hpp"

#include "raytracer_common/scene_geometry.hpp"

#include <arhost/shading/scalar.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>

namespace rt_embree {
namespace {

using arhost::Failure;
using arhost::raytracer_common::bytes;
using arhost::raytracer_common::elements;
using arhost::raytracer_common::image_of;
using arhost::raytracer_common::is_identity;
using arhost::raytracer_common::object_extent;
using arhost::raytracer_common::quantized_alpha;
using arhost::raytracer_common::transform_box;

unsigned mask_of(const Object &object) {
    return object.role == ARHOST_ROLE_CATCHER                ? catcher_mask
           : object.role == ARHOST_ROLE_OCCLUDER             ? occluder_mask
           : object.material->model == ARHOST_MATERIAL_GLASS ? glass_mask
                                                             : opaque_mask;
}

void set_transform(Object &object, const float *m) {
    std::copy_n(m, 9, object.transform);
    arhost::raytracer_common::Cofactors(m).write_normal_transform(object.normal_transform);
}

Object make_object(const arhost_scene &arena, const arhost_object &from) {
    Object object{};
    object.material = &elements<arhost_material>(arena, arena.materials)[from.material];
    object.role = from.role;
    object.has_transform = !is_identity(from.world_from_object);
    const bool is_path = arena.integrator == ARHOST_INTEGRATOR_PATH;
    const auto has = [&](float strength) { return strength > 0 && is_path; };
    const arhost_material &material = *object.material;
    object.has_coat = has(material.clearcoat);
    object.has_sheen = has(std::max({material.sheen[0], material.sheen[1], material.sheen[2]}));
    object.is_anisotropic = has(material.anisotropy);
    object.has_film = has(material.iridescence);
    const arhost_geometry &geometry = elements<arhost_geometry>(arena, arena.geometries)[from.geometry];
    if (geometry.type == ARHOST_GEOMETRY_TRIANGLES) {
        const auto floats = [&](const arhost_buffer &buffer) {
            return buffer.count ? reinterpret_cast<const float *>(bytes(arena) + buffer.offset) : nullptr;
        };
        object.positions = floats(geometry.positions);
        object.position_stride = geometry.positions.stride;
        object.normals = floats(geometry.normals);
        object.normal_stride = geometry.normals.stride;
        object.texcoords = floats(geometry.texcoords);
        object.texcoord_stride = geometry.texcoords.stride;
        object.indices = reinterpret_cast<const int *>(bytes(arena) + geometry.indices.offset);
        object.index_stride = geometry.indices.stride;
        object.tangents = floats(geometry.tangents);
        object.tangent_stride = geometry.tangents.stride;
        if (geometry.colours.count)
            object.colours = reinterpret_cast<const int *>(bytes(arena) + geometry.colours.offset);
        object.colour_stride = geometry.colours.stride;
        object.vertex_count = geometry.positions.count;
        object.blends = object.material->blends != 0 && is_path;
    }
    return object;
}

Box empty_box() {
    const double infinity = std::numeric_limits<double>::infinity();
    return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
}

// Returns the bounding box of `count` points that are `stride` bytes apart. If `spheres`, the fourth component of
// each point is the radius of a sphere around it.
Box box_of(const std::byte *points, std::uint32_t count, std::uint32_t stride, bool spheres) {
    Box box = empty_box();
    for (std::uint32_t i = 0; i < count; ++i, points += stride) {
        float p[4] = {};
        std::memcpy(p, points, spheres ? 16 : 12);
        for (int axis = 0; axis < 3; ++axis) {
            box.min[axis] = std::min(box.min[axis], double{p[axis]} - p[3]);
            box.max[axis] = std::max(box.max[axis], double{p[axis]} + p[3]);
        }
    }
    return box;
}

Box local_box(const arhost_scene &arena, const arhost_object &object) {
    const arhost_geometry &geometry = elements<arhost_geometry>(arena, arena.geometries)[object.geometry];
    return box_of(bytes(arena) + geometry.positions.offset, geometry.positions.count, geometry.positions.stride,
                  geometry.type == ARHOST_GEOMETRY_SPHERES);
}

Box transformed(const Box &local, const float *world_from_object) {
    if (local.min[0] > local.max[0])
        return local;
    Box world;
    transform_box(local.min, local.max, world_from_object, world.min, world.max);
    return world;
}

bool is_instance(const arhost_object &object) {
    return object.deforms || object.moves || !is_identity(object.world_from_object);
}

// Returns whether catchers get an additional BVH. In this BVH, rays that search for catchers do not traverse other
// triangles. It is not worth building if catchers, such as a scanned room, make up most of the scene.
bool needs_catcher_bvh(const arhost_scene &arena) {
    const auto geometries = elements<arhost_geometry>(arena, arena.geometries);
    std::uint64_t catcher_triangles = 0, all_triangles = 0;
    bool any_catcher = false;
    for (const arhost_object &object : elements<arhost_object>(arena, arena.objects)) {
        const std::uint64_t count = std::max(geometries[object.geometry].indices.count, std::uint32_t{1});
        all_triangles += count;
        if (object.role != ARHOST_ROLE_CATCHER)
            continue;
        if (is_instance(object))
            return false;
        any_catcher = true;
        catcher_triangles += count;
    }
    return any_catcher && 8 * catcher_triangles <= all_triangles;
}

// Spatial splits pay in large meshes only. In a room of 34 triangles, rays take 12 % longer with them.
RTCBuildQuality static_quality(const arhost_scene &arena) {
    const auto geometries = elements<arhost_geometry>(arena, arena.geometries);
    std::uint64_t triangles = 0;
    for (const arhost_object &object : elements<arhost_object>(arena, arena.objects))
        if (!object.moves && !object.deforms)
            triangles += geometries[object.geometry].indices.count;
    return triangles < 1000 ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH;
}

bool report_build(void *host, double fraction) {
    const auto &h = *static_cast<const arhost::Host *>(host);
    h.progress(fraction, "building the acceleration structure");
    return !h.cancelled();
}

void copy3(const float *from, float *to) {
    std::copy_n(from, 3, to);
}

} // namespace

EmbreeScene::EmbreeScene(const arhost_scene &arena, unsigned threads, bool robust, const arhost::Host &host)
    : arena_(arena), host_(host), robust_(robust), static_quality_(static_quality(arena)),
      device_(rtcNewDevice(("threads=" + std::to_string(threads) + ",set_affinity=0").c_str())),
      colour_tables_(std::make_unique<ColourTables>()) {
    check();
    for (const RTCDeviceProperty property :
         {RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED, RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED,
          RTC_DEVICE_PROPERTY_TRIANGLE_GEOMETRY_SUPPORTED, RTC_DEVICE_PROPERTY_POINT_GEOMETRY_SUPPORTED})
        if (!rtcGetDeviceProperty(device_.get(), property))
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                          "this build of Embree lacks one of ray masks, filter functions, "
                          "triangles and points; install one built with default options");

    const auto from = elements<arhost_object>(arena, arena.objects);
    const bool anything_moves =
        std::any_of(from.begin(), from.end(), [](const arhost_object &o) { return o.moves || o.deforms; });
    // If any object moves, static objects get their own scene, which is not rebuilt for each frame.
    root_ = new_scene(anything_moves ? RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_NONE);
    if (anything_moves)
        static_ = new_scene(RTC_SCENE_FLAG_NONE);
    if (needs_catcher_bvh(arena))
        catchers_ = new_scene(RTC_SCENE_FLAG_NONE);
    for (const arhost_texture &texture : elements<arhost_texture>(arena, arena.textures)) {
        const arhost_texel_image &image = image_of(arena, texture);
        Texture &to = textures_.emplace_back(
            Texture{bytes(arena) + image.texels.offset, static_cast<std::int32_t>(image.width),
                    static_cast<std::int32_t>(image.height), image.format, texture.wrap_u, texture.wrap_v,
                    texture.filter == ARHOST_TEXEL_FILTER_NEAREST, texture.texcoord_set});
        std::ranges::copy(texture.image_from_texcoord, to.image_from_texcoord);
        to.level_count = static_cast<std::int32_t>(image.level_count);
        view_.has_image_levels |= image.level_count > 1;
        for (std::int32_t level = 1; level < to.level_count; ++level)
            to.first_of_level[level] = to.first_of_level[level - 1] +
                                       std::max(to.width >> (level - 1), 1) * std::max(to.height >> (level - 1), 1);
    }
    view_.textures = textures_.data();
    for (std::uint32_t number = 0; number < from.size(); ++number) {
        const arhost_object &object = from[number];
        objects_.push_back(make_object(arena, object));
        placements_.push_back({local_box(arena, object), {}, true});
        visible_boxes_.push_back(empty_box());
        place_object(number, object.world_from_object);
        view_.has_several_real |= object.role != ARHOST_ROLE_VIRTUAL && (view_.has_catchers || view_.has_occluders);
        view_.has_catchers |= object.role == ARHOST_ROLE_CATCHER;
        view_.has_occluders |= object.role == ARHOST_ROLE_OCCLUDER;
        view_.has_gloss |= arena.integrator == ARHOST_INTEGRATOR_PATH && object.role == ARHOST_ROLE_CATCHER &&
                           objects_.back().material->model == ARHOST_MATERIAL_METALLIC_ROUGHNESS;
        view_.has_glass |= mask_of(objects_.back()) == glass_mask;

        if (object.deforms) {
            attach(root_.get(), new_instance(deforming_scene(number), object.world_from_object), number);
        } else if (is_instance(object)) {
            attach(root_.get(), new_instance(instanced_scene(number), object.world_from_object), number);
        } else {
            const GeometryHandle geometry = new_geometry(number);
            attach(static_ ? static_.get() : root_.get(), geometry, number);
            if (catchers_ && object.role == ARHOST_ROLE_CATCHER)
                rtcAttachGeometryByID(catchers_.get(), geometry.get(), number);
        }
    }
    view_.static_instance = -2;
    if (static_) {
        commit(static_.get());
        constexpr float identity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
        const GeometryHandle instance = new_instance(static_.get(), identity);
        rtcSetGeometryMask(instance.get(), all_masks);
        rtcCommitGeometry(instance.get());
        view_.static_instance = static_cast<std::int32_t>(from.size());
        rtcAttachGeometryByID(root_.get(), instance.get(), static_cast<unsigned>(from.size()));
    }
    commit(root_.get());
    if (catchers_)
        commit(catchers_.get());

    view_.root = root_.get();
    view_.catchers = catchers_ ? catchers_.get() : root_.get();
    view_.packet_width = native_packet_width(device_.get());
    view_.objects = objects_.data();
    const auto lights = elements<arhost_light>(arena, arena.lights);
    view_.lights = lights.data();
    view_.light_count = arena.lights.count;
    view_.has_area_lights = std::any_of(lights.begin(), lights.end(), [](const arhost_light &light) {
        return light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE ||
               (light.type == ARHOST_LIGHT_SPOT && light.radius > 0);
    });
    view_.max_depth = arena.max_depth;
    copy3(arena.ambient, view_.ambient);
    copy3(arena.background, view_.background);
    view_.has_ambient = std::ranges::any_of(arena.ambient, [](float c) { return c > 0; });
    view_.has_background = arena.environment.texture == ARHOST_NONE &&
                           std::any_of(arena.background, arena.background + 3, [](float c) { return c > 0; });
    view_.shadow_alpha_opaque = quantized_alpha(arena.shadow_alpha_opaque);
    view_.shadow_alpha_translucent = quantized_alpha(arena.shadow_alpha_translucent);
    view_.coloured_shadows = arena.coloured_shadows != 0;
    view_.linear_of_srgb8 = colour_tables_->linear_of_srgb8.data();
    if (const arhost_environment &from = arena.environment; from.texture != ARHOST_NONE) {
        Environment &to = view_.environment;
        to.image = &textures_[from.texture];
        std::copy_n(from.environment_from_world, 9, to.environment_from_world);
        to.rows = elements<float>(arena, from.rows).data();
        to.columns = elements<float>(arena, from.columns).data();
    }
}

void EmbreeScene::set_environment_scale(const std::array<float, 3> &scale) {
    std::ranges::copy(scale, view_.environment.intensity);
}

void EmbreeScene::move(const arhost_motion &motion) {
    for (std::uint32_t i = 0; i < motion.moved_count; ++i) {
        const arhost_moved_object &moved = motion.moved[i];
        objects_[moved.object].has_transform = true;
        place_object(moved.object, moved.world_from_object);
        const RTCGeometry instance = rtcGetGeometry(root_.get(), moved.object);
        rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, moved.world_from_object);
        show(moved.object, instance, moved.is_visible != 0);
    }
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i)
        deform(motion.deformed[i]);
    commit(root_.get());
}

void EmbreeScene::deform(const arhost_deformed_geometry &deformed) {
    // Threshold of degradation above which tracing a few frames through a refitted BVH costs more than rebuilding it
    // (measured with rt-embree-refit).
    constexpr double max_degradation = 1.3;
    Object &object = objects_[deformed.object];
    object.positions = deformed.positions;
    object.position_stride = 3 * sizeof(float);
    object.normals = deformed.normals;
    object.normal_stride = 3 * sizeof(float);
    const arhost_object &from = elements<arhost_object>(arena_, arena_.objects)[deformed.object];
    const arhost_geometry &geometry = elements<arhost_geometry>(arena_, arena_.geometries)[from.geometry];
    const auto *positions = reinterpret_cast<const std::byte *>(deformed.positions);
    const MeshView mesh{positions, bytes(arena_) + geometry.indices.offset, 3 * sizeof(float),
                        geometry.indices.stride, geometry.indices.count};

    Deforming &state = deforming_.at(deformed.object);
    rtcSetSharedGeometryBuffer(state.geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions, 0,
                               3 * sizeof(float), deformed.vertex_count);
    const bool rebuild = state.quality.degradation(mesh) > max_degradation;
    rtcSetGeometryBuildQuality(state.geometry.get(), rebuild ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_REFIT);
    rtcUpdateGeometryBuffer(state.geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(state.geometry.get());
    commit(state.scene.get());
    if (rebuild) {
        state.quality.record_build(mesh);
        ++rebuilds_;
    }
    const RTCGeometry instance = rtcGetGeometry(root_.get(), deformed.object);
    placements_[deformed.object].local = box_of(positions, deformed.vertex_count, 3 * sizeof(float), false);
    update_bounds(deformed.object);
    show(deformed.object, instance, deformed.is_visible != 0);
}

// Commits the instance, which also makes Embree notice that its bounds have changed. No ray hits an object whose mask
// is 0.
void EmbreeScene::show(std::uint32_t object, RTCGeometry instance, bool is_visible) {
    rtcSetGeometryMask(instance, is_visible ? mask_of(objects_[object]) : 0);
    rtcCommitGeometry(instance);
    placements_[object].is_visible = is_visible;
    if (!is_visible)
        visible_boxes_[object] = empty_box();
}

std::vector<arhost::raytracer_common::PlacedObject> EmbreeScene::placed_objects() const {
    const auto from = elements<arhost_object>(arena_, arena_.objects);
    std::vector<arhost::raytracer_common::PlacedObject> placed;
    for (std::uint32_t i = 0; i < from.size(); ++i)
        placed.push_back({placements_[i].world_from_object.data(), from[i].deforms ? objects_[i].positions : nullptr,
                          objects_[i].position_stride, placements_[i].is_visible});
    return placed;
}

void EmbreeScene::set_emitters(std::span<const arhost::raytracer_common::Emitter> emitters) {
    for (std::size_t i = 0; i < emitters.size(); ++i) {
        objects_[i].emitter_density = emitters[i].density;
        objects_[i].ball_radius = emitters[i].ball_radius;
    }
}

void EmbreeScene::place_object(std::uint32_t object, const float *world_from_object) {
    set_transform(objects_[object], world_from_object);
    std::copy_n(world_from_object, 12, placements_[object].world_from_object.begin());
    update_bounds(object);
}

void EmbreeScene::update_bounds(std::uint32_t object) {
    const Placement &placement = placements_[object];
    const float *world_from_object = placement.world_from_object.data();
    object_extent(placement.local.min, placement.local.max, world_from_object, objects_[object].extent);
    if (objects_[object].role != ARHOST_ROLE_OCCLUDER)
        visible_boxes_[object] = transformed(placement.local, world_from_object);
}

SceneHandle EmbreeScene::new_scene(RTCSceneFlags flags) const {
    SceneHandle scene(rtcNewScene(device_.get()));
    check();
    rtcSetSceneFlags(scene.get(),
                     static_cast<RTCSceneFlags>(flags | (robust_ ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE)));
    rtcSetSceneBuildQuality(scene.get(), flags & RTC_SCENE_FLAG_DYNAMIC ? RTC_BUILD_QUALITY_MEDIUM : static_quality_);
    return scene;
}

GeometryHandle EmbreeScene::new_instance(RTCScene of, const float *world_from_object) const {
    GeometryHandle instance(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(instance.get(), of);
    rtcSetGeometryTransform(instance.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, world_from_object);
    return instance;
}

void EmbreeScene::attach(RTCScene to, const GeometryHandle &geometry, std::uint32_t number) const {
    rtcSetGeometryMask(geometry.get(), mask_of(objects_[number]));
    rtcCommitGeometry(geometry.get());
    rtcAttachGeometryByID(to, geometry.get(), number);
    check();
}

RTCScene EmbreeScene::deforming_scene(std::uint32_t number) {
    const arhost_object &object = elements<arhost_object>(arena_, arena_.objects)[number];
    const arhost_geometry &from = elements<arhost_geometry>(arena_, arena_.geometries)[object.geometry];
    Deforming &state = deforming_[number];
    state.scene = new_scene(RTC_SCENE_FLAG_DYNAMIC);
    // At low build quality, Embree gives each geometry its own BVH, which can be refitted. At higher quality, BVHs
    // cannot be refitted.
    rtcSetSceneBuildQuality(state.scene.get(), RTC_BUILD_QUALITY_LOW);
    state.geometry = new_geometry(number);
    rtcSetGeometryMask(state.geometry.get(), all_masks);
    rtcSetGeometryBuildQuality(state.geometry.get(), RTC_BUILD_QUALITY_MEDIUM);
    rtcCommitGeometry(state.geometry.get());
    rtcAttachGeometry(state.scene.get(), state.geometry.get());
    commit(state.scene.get());
    state.quality.record_build({bytes(arena_) + from.positions.offset, bytes(arena_) + from.indices.offset,
                                from.positions.stride, from.indices.stride, from.indices.count});
    return state.scene.get();
}

GeometryHandle EmbreeScene::new_geometry(std::uint32_t number) {
    const arhost_object &object = elements<arhost_object>(arena_, arena_.objects)[number];
    const arhost_geometry &from = elements<arhost_geometry>(arena_, arena_.geometries)[object.geometry];
    const bool spheres = from.type == ARHOST_GEOMETRY_SPHERES;
    GeometryHandle geometry(
        rtcNewGeometry(device_.get(), spheres ? RTC_GEOMETRY_TYPE_SPHERE_POINT : RTC_GEOMETRY_TYPE_TRIANGLE));
    const auto set_buffer = [&](RTCBufferType type, RTCFormat format, const arhost_buffer &buffer) {
        rtcSetSharedGeometryBuffer(geometry.get(), type, 0, format, &arena_, buffer.offset, buffer.stride,
                                   buffer.count);
    };
    set_buffer(RTC_BUFFER_TYPE_VERTEX, spheres ? RTC_FORMAT_FLOAT4 : RTC_FORMAT_FLOAT3, from.positions);
    if (!spheres)
        set_buffer(RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, from.indices);
    if (const HitFilter filter = hit_filter_of(objects_[number], object.hides_back_faces != 0, textures_.data());
        filter.is_needed())
        set_hit_filter(geometry.get(), *hit_filters_.emplace_back(std::make_unique<HitFilter>(filter)));
    return geometry;
}

RTCScene EmbreeScene::instanced_scene(std::uint32_t number) {
    const arhost_object &object = elements<arhost_object>(arena_, arena_.objects)[number];
    const std::uint32_t shape = object.geometry;
    const HitFilter filter = hit_filter_of(objects_[number], object.hides_back_faces != 0, textures_.data());
    for (const Instanced &known : instanced_)
        if (known.geometry == shape && known.filter == filter)
            return known.scene.get();
    SceneHandle scene = new_scene(RTC_SCENE_FLAG_NONE);
    const GeometryHandle geometry = new_geometry(number);
    rtcSetGeometryMask(geometry.get(), all_masks);
    rtcCommitGeometry(geometry.get());
    rtcAttachGeometry(scene.get(), geometry.get());
    commit(scene.get());
    instanced_.push_back({shape, filter, std::move(scene)});
    return instanced_.back().scene.get();
}

void EmbreeScene::commit(RTCScene scene) const {
    const auto stop_if_cancelled = [&] { // needed because Embree does not call the progress monitor for small scenes
        if (host_.cancelled())
            throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while building the acceleration structure");
    };
    stop_if_cancelled();
    rtcSetSceneProgressMonitorFunction(scene, report_build, const_cast<arhost::Host *>(&host_));
    rtcCommitScene(scene);
    rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
    stop_if_cancelled();
    check();
}

// Throws if an Embree function that this thread called since the last check() has failed. Reports the first error.
void EmbreeScene::check() const {
    switch (const RTCError error = rtcGetDeviceError(device_.get())) {
    case RTC_ERROR_NONE:
        return;
    case RTC_ERROR_OUT_OF_MEMORY:
        throw std::bad_alloc();
    case RTC_ERROR_CANCELLED:
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while building the acceleration structure");
    case RTC_ERROR_UNSUPPORTED_CPU:
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "Embree does not support this processor");
    default:
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "Embree reports error code " + std::to_string(error));
    }
}

} // namespace rt_embree
