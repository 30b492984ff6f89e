// SPDX-License-Identifier: Apache-2.0
#include "acceleration_structures.hpp"

#include "raytracer_common/scene_geometry.hpp"
#include "scene_data.hpp"

#include <algorithm>
#include <cstring>

namespace rt_vulkan {
namespace {

using arhost::Failure;
using arhost::raytracer_common::bytes;
using arhost::raytracer_common::elements;

// Number of refits between rebuilds. Refitted structures degrade as meshes deform; measuring the degradation would
// cost more than rebuilding at this interval.
constexpr std::uint32_t max_refits = 60;
constexpr VkDeviceSize block_size = VkDeviceSize{4} << 20; // bytes
constexpr VkDeviceSize structure_alignment = 256;          // bytes, required by the Vulkan specification

constexpr VkBufferUsageFlags storage_usage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkBufferUsageFlags scratch_usage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// Inserts a barrier that makes earlier uploads and builds visible to the next build.
void await_inputs(const VolkDeviceTable &vk, VkCommandBuffer commands) {
    barrier(vk, commands, VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            VK_ACCESS_TRANSFER_WRITE_BIT | VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
            VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR);
}

VkAccelerationStructureGeometryKHR triangles(VkDeviceAddress vertices, VkDeviceSize stride,
                                             std::uint32_t vertex_count, VkDeviceAddress indices) {
    return {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
            .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
            .geometry = {.triangles = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
                                       .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                                       .vertexData = {.deviceAddress = vertices},
                                       .vertexStride = stride,
                                       .maxVertex = vertex_count - 1,
                                       .indexType = VK_INDEX_TYPE_UINT32,
                                       .indexData = {.deviceAddress = indices}}}};
}

VkAccelerationStructureGeometryKHR boxes(VkDeviceAddress address) {
    static_assert(sizeof(Box) == sizeof(VkAabbPositionsKHR));
    return {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
            .geometryType = VK_GEOMETRY_TYPE_AABBS_KHR,
            .geometry = {.aabbs = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_AABBS_DATA_KHR,
                                   .data = {.deviceAddress = address},
                                   .stride = sizeof(Box)}}};
}

VkAccelerationStructureGeometryKHR instances(VkDeviceAddress address) {
    return {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
            .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR,
            .geometry = {.instances = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
                                       .data = {.deviceAddress = address}}}};
}

} // namespace

AccelerationStructures::AccelerationStructures(const Device &device, const Submission &submission,
                                               const arhost_scene &arena, std::span<const Object> objects,
                                               const Buffer &indices, VkPipelineStageFlags readers,
                                               const arhost::Host &host)
    : device_(device), submission_(submission), arena_(arena), host_(host), readers_(readers),
      instances_(objects.size()),
      refits_(max_refits) { // makes the first update rebuild: the arena's vertices may differ from all poses
    const auto geometries = elements<arhost_geometry>(arena, arena.geometries);
    const auto from = elements<arhost_object>(arena, arena.objects);
    const auto check_limit = [&](std::uint64_t count, std::uint64_t limit, const char *what) {
        if (count > limit)
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "the Vulkan device '" + device.physical().name +
                                                               "' traces at most " + std::to_string(limit) + " " +
                                                               what + ", but the scene has " + std::to_string(count) +
                                                               "; set option 'path' to 'plain', or use rt_embree");
    };
    // An object's index must fit instanceCustomIndex, which has 24 bits.
    check_limit(from.size(), std::min<std::uint64_t>(device.physical().tracing.max_objects, 1u << 24), "objects");

    std::size_t moving_size = instances_.size() * sizeof(VkAccelerationStructureInstanceKHR);
    for (std::uint32_t i = 0; i < from.size(); ++i) {
        const arhost_geometry &geometry = geometries[from[i].geometry];
        const bool has_spheres = geometry.type == ARHOST_GEOMETRY_SPHERES;
        const std::uint32_t count = has_spheres ? geometry.positions.count : geometry.indices.count;
        check_limit(count, device.physical().tracing.max_primitives, "triangles or spheres per mesh");
        if (count == 0 || bottom_level_.contains(from[i].geometry))
            continue;
        Structure &structure = bottom_level_[from[i].geometry];
        structure.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        structure.count = count;
        structure.geometry = has_spheres ? boxes(0)
                                         : triangles(0, geometry.positions.stride, geometry.positions.count,
                                                     indices.address() + VkDeviceSize{4} * objects[i].first_index);
        if (!from[i].deforms) {
            build_static(structure, geometry);
            continue;
        }
        structure.geometry.geometry.triangles.vertexStride = 3 * sizeof(float);
        structure.vertices_offset = moving_size;
        moving_size += 3 * sizeof(float) * geometry.positions.count;
    }
    moving_ = Buffer(device, std::max<std::size_t>(moving_size, 16), build_input_usage, Buffer::Place::host_written);
    for (auto &[geometry, structure] : bottom_level_) {
        if (!structure.vertices_offset)
            continue;
        const arhost_buffer &positions = geometries[geometry].positions;
        const auto *first = bytes(arena) + positions.offset;
        std::byte *to = moving_.mapped().data() + structure.vertices_offset;
        for (std::uint32_t i = 0; i < positions.count; ++i)
            std::memcpy(to + 3 * sizeof(float) * i, first + std::size_t{positions.stride} * i, 3 * sizeof(float));
    }
    build_moving(); // creates all structures: the instances need their addresses
    for (std::uint32_t i = 0; i < from.size(); ++i) {
        VkAccelerationStructureInstanceKHR &instance = instances_[i];
        instance.instanceCustomIndex = i;
        instance.mask = objects[i].mask;
        // Selects the hit group in the shader binding table: 0 for triangles, 1 for spheres.
        instance.instanceShaderBindingTableRecordOffset = objects[i].flags & is_spheres ? 1 : 0;
        instance.flags = objects[i].flags & rejects_hits ? VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR
                                                         : VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR;
        const auto structure = bottom_level_.find(
            from[i].geometry); // absent if the mesh is empty; rays ignore instances with reference 0
        instance.accelerationStructureReference = structure == bottom_level_.end() ? 0 : address(structure->second);
        set_transform(i, from[i].world_from_object);
        write_instance(i);
    }
    submission.run(rebuild_);
}

AccelerationStructures::Storage AccelerationStructures::allocate(VkDeviceSize size) {
    if (blocks_.empty() || blocks_.back().size() - filled_ < size) {
        blocks_.emplace_back(device_, std::max(size, block_size), storage_usage, Buffer::Place::device);
        filled_ = 0;
    }
    const Storage storage{blocks_.back().get(), filled_};
    filled_ = std::min(aligned(filled_ + size, structure_alignment), blocks_.back().size());
    return storage;
}

void AccelerationStructures::create(Structure &structure, VkDeviceSize size, Storage storage) const {
    const VkAccelerationStructureCreateInfoKHR info{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR,
                                                    .buffer = storage.buffer,
                                                    .offset = storage.offset,
                                                    .size = size,
                                                    .type = structure.type};
    structure.handle = {device_, device_.functions().vkCreateAccelerationStructureKHR, info,
                        "creating an acceleration structure"};
}

VkAccelerationStructureBuildGeometryInfoKHR
AccelerationStructures::build_info(const Structure &structure, bool refits, VkDeviceAddress scratch) const {
    return {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
            .type = structure.type,
            .flags = structure.flags,
            .mode = refits ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                           : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
            .srcAccelerationStructure = refits ? structure.handle.get() : VK_NULL_HANDLE,
            .dstAccelerationStructure = structure.handle.get(),
            .geometryCount = 1,
            .pGeometries = &structure.geometry,
            .scratchData = {.deviceAddress = scratch}};
}

VkAccelerationStructureBuildSizesInfoKHR AccelerationStructures::build_sizes(const Structure &structure) const {
    VkAccelerationStructureBuildSizesInfoKHR sizes{.sType =
                                                       VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    const auto info = build_info(structure, false, 0);
    device_.functions().vkGetAccelerationStructureBuildSizesKHR(
        device_.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &structure.count, &sizes);
    return sizes;
}

VkDeviceAddress AccelerationStructures::address(const Structure &structure) const {
    const VkAccelerationStructureDeviceAddressInfoKHR which{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
        .accelerationStructure = structure.handle.get()};
    return device_.functions().vkGetAccelerationStructureDeviceAddressKHR(device_.handle(), &which);
}

// Builds and compacts the structure of a geometry that does not deform.
void AccelerationStructures::build_static(Structure &structure, const arhost_geometry &geometry) {
    if (host_.cancelled())
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while building acceleration structures");
    const VolkDeviceTable &vk = device_.functions();
    const arhost_buffer &positions = geometry.positions;
    const auto *first = bytes(arena_) + positions.offset;
    std::vector<Box> sphere_boxes;
    std::span<const std::byte> input(first, std::size_t{positions.stride} * (positions.count - 1) + 12);
    if (geometry.type == ARHOST_GEOMETRY_SPHERES) {
        sphere_boxes = boxes_of(arena_, geometry, {first, positions.stride});
        input = std::as_bytes(std::span(sphere_boxes));
    }
    const Buffer input_buffer(device_, input.size(), build_input_usage | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                              Buffer::Place::device);
    upload(device_, submission_, input_buffer, {&input, 1});
    if (geometry.type == ARHOST_GEOMETRY_SPHERES)
        structure.geometry.geometry.aabbs.data.deviceAddress = input_buffer.address();
    else
        structure.geometry.geometry.triangles.vertexData.deviceAddress = input_buffer.address();
    structure.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                      VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;

    const auto sizes = build_sizes(structure);
    const VkDeviceSize alignment = device_.physical().tracing.scratch_alignment;
    const Buffer storage(device_, sizes.accelerationStructureSize, storage_usage, Buffer::Place::device);
    const Buffer scratch(device_, sizes.buildScratchSize + alignment, scratch_usage, Buffer::Place::device);
    create(structure, sizes.accelerationStructureSize, {storage.get(), 0});
    const VkQueryPoolCreateInfo pool_info{.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
                                          .queryType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                                          .queryCount = 1};
    const QueryPool pool(device_, vk.vkCreateQueryPool, pool_info, "querying an acceleration structure's size");

    const VkCommandBuffer commands = submission_.new_commands();
    submission_.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    await_inputs(vk, commands);
    const auto info = build_info(structure, false, aligned(scratch.address(), alignment));
    const VkAccelerationStructureBuildRangeInfoKHR range{structure.count, 0, 0, 0}, *const ranges = &range;
    vk.vkCmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    await_inputs(vk, commands);
    const VkAccelerationStructureKHR built = structure.handle.get();
    vk.vkCmdResetQueryPool(commands, pool.get(), 0, 1);
    vk.vkCmdWriteAccelerationStructuresPropertiesKHR(
        commands, 1, &built, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, pool.get(), 0);
    submission_.end(commands);
    submission_.run(commands);
    VkDeviceSize compacted_size = 0;
    check(vk.vkGetQueryPoolResults(device_.handle(), pool.get(), 0, 1, sizeof compacted_size, &compacted_size,
                                   sizeof compacted_size, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
          "querying an acceleration structure's size");

    const AccelerationStructure uncompacted = std::move(structure.handle);
    create(structure, compacted_size, allocate(compacted_size));
    submission_.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    await_inputs(vk, commands);
    const VkCopyAccelerationStructureInfoKHR copy{.sType = VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_INFO_KHR,
                                                  .src = uncompacted.get(),
                                                  .dst = structure.handle.get(),
                                                  .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR};
    vk.vkCmdCopyAccelerationStructureKHR(commands, &copy);
    submission_.end(commands);
    submission_.run(commands);
    submission_.free(commands);
}

// Creates the structures of deforming meshes and the top-level structure, and records the command buffers that build
// and refit them.
void AccelerationStructures::build_moving() {
    const VkDeviceSize alignment = device_.physical().tracing.scratch_alignment;
    VkDeviceSize scratch_size = 0;
    const auto prepare = [&](Structure &structure) {
        const auto sizes = build_sizes(structure);
        create(structure, sizes.accelerationStructureSize, allocate(sizes.accelerationStructureSize));
        structure.scratch_offset = scratch_size;
        structure.scratch_size = std::max(sizes.buildScratchSize, sizes.updateScratchSize);
        scratch_size = aligned(scratch_size + structure.scratch_size, alignment);
    };
    for (auto &[geometry, structure] : bottom_level_)
        if (structure.vertices_offset) {
            structure.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                              VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
            structure.geometry.geometry.triangles.vertexData.deviceAddress =
                moving_.address() + structure.vertices_offset;
            prepare(structure);
        }
    top_level_.type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    top_level_.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    top_level_.count = static_cast<std::uint32_t>(instances_.size());
    top_level_.geometry = instances(moving_.address());
    prepare(top_level_);
    scratch_ = Buffer(device_, scratch_size + alignment, scratch_usage, Buffer::Place::device);
    refit_ = submission_.new_commands();
    rebuild_ = submission_.new_commands();
    record_moving(rebuild_, false); // recorded first: validation layers assume that buffers execute in this order
    record_moving(refit_, true);
}

// Records commands that refit (`refits`) or build the structures of deforming meshes, and commands that rebuild the
// top-level structure. The top-level structure is never refitted: it is small, and refitting would degrade it as
// objects move apart.
void AccelerationStructures::record_moving(VkCommandBuffer commands, bool refits) const {
    const VolkDeviceTable &vk = device_.functions();
    const VkDeviceAddress scratch = aligned(scratch_.address(), device_.physical().tracing.scratch_alignment);
    submission_.begin(commands);
    await_inputs(vk, commands);
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
    for (const auto &[geometry, structure] : bottom_level_)
        if (structure.vertices_offset) {
            infos.push_back(build_info(structure, refits, scratch + structure.scratch_offset));
            ranges.push_back({structure.count, 0, 0, 0});
        }
    if (!infos.empty()) {
        std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> each(ranges.size());
        std::transform(ranges.begin(), ranges.end(), each.begin(), [](const auto &range) { return &range; });
        vk.vkCmdBuildAccelerationStructuresKHR(commands, static_cast<std::uint32_t>(infos.size()), infos.data(),
                                               each.data());
        await_inputs(vk, commands);
    }
    const auto info = build_info(top_level_, false, scratch + top_level_.scratch_offset);
    const VkAccelerationStructureBuildRangeInfoKHR range{top_level_.count, 0, 0, 0}, *const top_ranges = &range;
    vk.vkCmdBuildAccelerationStructuresKHR(commands, 1, &info, &top_ranges);
    barrier(vk, commands, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR, readers_, VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR);
    submission_.end(commands);
}

void AccelerationStructures::set_transform(std::uint32_t object, const float *m) {
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            instances_[object].transform.matrix[row][column] = m[3 * column + row];
}

void AccelerationStructures::write_instance(std::uint32_t object) {
    const VkAccelerationStructureInstanceKHR &instance = instances_[object];
    std::memcpy(moving_.mapped().data() + sizeof instance * object, &instance, sizeof instance);
}

VkCommandBuffer AccelerationStructures::update(const arhost_motion &motion, std::span<const Object> objects) {
    for (std::uint32_t i = 0; i < motion.moved_count; ++i) {
        const std::uint32_t object = motion.moved[i].object;
        instances_[object].mask = objects[object].mask;
        set_transform(object, motion.moved[i].world_from_object);
        write_instance(object);
    }
    const auto from = elements<arhost_object>(arena_, arena_.objects);
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i) {
        const arhost_deformed_geometry &deformed = motion.deformed[i];
        instances_[deformed.object].mask = objects[deformed.object].mask;
        write_instance(deformed.object);
        const auto structure = bottom_level_.find(from[deformed.object].geometry);
        if (structure != bottom_level_.end())
            std::memcpy(moving_.mapped().data() + structure->second.vertices_offset, deformed.positions,
                        3 * sizeof(float) * deformed.vertex_count);
    }
    if (++refits_ <= max_refits)
        return refit_;
    refits_ = 0;
    return rebuild_;
}

} // namespace rt_vulkan
