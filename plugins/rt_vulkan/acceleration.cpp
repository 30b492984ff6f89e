// SPDX-License-Identifier: Apache-2.0
#include "acceleration.hpp"

#include "raytracer_common/arena.hpp"
#include "scene_data.hpp"

#include <algorithm>
#include <cstring>

namespace rt_vulkan {
namespace {

using arhost::Failure;
using arhost::raytracer_common::elements;

// Refitted trees decay as meshes deform; who looked by how much would pay more than for this.
constexpr std::uint32_t max_refits = 60;
constexpr VkDeviceSize block_size = VkDeviceSize{4} << 20; // bytes
constexpr VkDeviceSize structure_alignment = 256;          // bytes, by the specification

constexpr VkBufferUsageFlags storage_usage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkBufferUsageFlags scratch_usage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// What earlier commands have uploaded or built can be built from.
void await_inputs(const DeviceFunctions &vk, VkCommandBuffer commands) {
    barrier(vk, commands, VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            VK_ACCESS_TRANSFER_WRITE_BIT | VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
            VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR);
}

VkAccelerationStructureGeometryKHR triangles(VkDeviceAddress vertices, VkDeviceSize stride,
                                             std::uint32_t vertex_count, VkDeviceAddress indices) {
    VkAccelerationStructureGeometryKHR geometry{};
    geometry.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
    geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
    auto &data = geometry.geometry.triangles;
    data.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR;
    data.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    data.vertexData.deviceAddress = vertices;
    data.vertexStride = stride;
    data.maxVertex = vertex_count - 1;
    data.indexType = VK_INDEX_TYPE_UINT32;
    data.indexData.deviceAddress = indices;
    return geometry;
}

VkAccelerationStructureGeometryKHR boxes(VkDeviceAddress address) {
    static_assert(sizeof(Box) == sizeof(VkAabbPositionsKHR));
    VkAccelerationStructureGeometryKHR geometry{};
    geometry.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
    geometry.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
    geometry.geometry.aabbs.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_AABBS_DATA_KHR;
    geometry.geometry.aabbs.data.deviceAddress = address;
    geometry.geometry.aabbs.stride = sizeof(Box);
    return geometry;
}

VkAccelerationStructureGeometryKHR instances(VkDeviceAddress address) {
    VkAccelerationStructureGeometryKHR geometry{};
    geometry.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR;
    geometry.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
    geometry.geometry.instances.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR;
    geometry.geometry.instances.data.deviceAddress = address;
    return geometry;
}

} // namespace

Acceleration::Acceleration(const Device &device, const Submission &submission, const arhost_scene &arena,
                           std::span<const Object> objects, const Buffer &indices, VkPipelineStageFlags readers,
                           const arhost::Host &host)
    : device_(device), submission_(submission), arena_(arena), host_(host), readers_(readers),
      instances_(objects.size()), refits_(max_refits) { // what the arena has need be no pose: built anew at once
    const auto geometries = elements<arhost_geometry>(arena, arena.geometries);
    const auto from = elements<arhost_object>(arena, arena.objects);
    const auto refuse_over = [&](std::uint64_t count, std::uint64_t most, const char *what) {
        if (count > most)
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, "the Vulkan device '" + device.physical().name +
                                                               "' traces " + std::to_string(most) + " " + what +
                                                               " at most, and there are " + std::to_string(count) +
                                                               ": use option 'path': plain, or rt_embree");
    };
    // Instances have 24 bits for their objects' numbers.
    refuse_over(from.size(), std::min<std::uint64_t>(device.physical().tracing.max_objects, 1u << 24), "objects");

    std::size_t moving_size = instances_.size() * sizeof(VkAccelerationStructureInstanceKHR);
    for (std::uint32_t i = 0; i < from.size(); ++i) {
        const arhost_geometry &geometry = geometries[from[i].geometry];
        const bool has_spheres = geometry.type == ARHOST_GEOMETRY_SPHERES;
        const std::uint32_t count = has_spheres ? geometry.positions.count : geometry.indices.count;
        refuse_over(count, device.physical().tracing.max_primitives, "triangles or spheres of a mesh");
        if (count == 0 || trees_.contains(from[i].geometry))
            continue;
        Tree &tree = trees_[from[i].geometry];
        tree.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        tree.count = count;
        tree.geometry = has_spheres ? boxes(0)
                                    : triangles(0, geometry.positions.stride, geometry.positions.count,
                                                indices.address() + VkDeviceSize{4} * objects[i].first_index);
        if (!from[i].deforms) {
            build_still(tree, geometry);
            continue;
        }
        tree.geometry.geometry.triangles.vertexStride = 3 * sizeof(float);
        tree.vertices_offset = moving_size;
        moving_size += 3 * sizeof(float) * geometry.positions.count;
    }
    moving_ = Buffer(device, std::max<std::size_t>(moving_size, 16), tree_input_usage, Buffer::Place::host_written);
    for (auto &[number, tree] : trees_) {
        if (!tree.vertices_offset)
            continue;
        const arhost_buffer &positions = geometries[number].positions;
        const auto *first = arhost::raytracer_common::bytes(arena) + positions.offset;
        std::byte *to = moving_.mapped().data() + tree.vertices_offset;
        for (std::uint32_t i = 0; i < positions.count; ++i)
            std::memcpy(to + 3 * sizeof(float) * i, first + std::size_t{positions.stride} * i, 3 * sizeof(float));
    }
    build_moving(); // gives all trees their addresses, which the instances need
    for (std::uint32_t i = 0; i < from.size(); ++i) {
        VkAccelerationStructureInstanceKHR &instance = instances_[i];
        instance.instanceCustomIndex = i;
        instance.mask = objects[i].mask;
        // Of the shader binding table's two groups for hits.
        instance.instanceShaderBindingTableRecordOffset = objects[i].flags & is_spheres ? 1 : 0;
        instance.flags = objects[i].flags & has_holes ? VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR
                                                      : VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR;
        const auto tree = trees_.find(from[i].geometry); // one of nothing is never hit
        instance.accelerationStructureReference = tree == trees_.end() ? 0 : address(tree->second);
        place(i, from[i].world_from_object);
    }
    submission.run(rebuild_);
}

Acceleration::Place Acceleration::room(VkDeviceSize size) {
    if (blocks_.empty() || blocks_.back().size() - filled_ < size) {
        blocks_.emplace_back(device_, std::max(size, block_size), storage_usage, Buffer::Place::device);
        filled_ = 0;
    }
    const Place place{blocks_.back().get(), filled_};
    filled_ = std::min(aligned(filled_ + size, structure_alignment), blocks_.back().size());
    return place;
}

void Acceleration::create(Tree &tree, VkDeviceSize size, Place place) const {
    VkAccelerationStructureCreateInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR;
    info.buffer = place.buffer;
    info.offset = place.offset;
    info.size = size;
    info.type = tree.type;
    tree.structure = make<AccelerationStructure, VkAccelerationStructureKHR>(
        device_, device_.functions().vkCreateAccelerationStructureKHR, info, "making a tree");
}

VkAccelerationStructureBuildGeometryInfoKHR Acceleration::build_info(const Tree &tree, bool refits,
                                                                     VkDeviceAddress scratch) const {
    VkAccelerationStructureBuildGeometryInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR;
    info.type = tree.type;
    info.flags = tree.flags;
    info.mode =
        refits ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    info.srcAccelerationStructure = refits ? tree.structure.get() : VK_NULL_HANDLE;
    info.dstAccelerationStructure = tree.structure.get();
    info.geometryCount = 1;
    info.pGeometries = &tree.geometry;
    info.scratchData.deviceAddress = scratch;
    return info;
}

VkAccelerationStructureBuildSizesInfoKHR Acceleration::sizes(const Tree &tree) const {
    VkAccelerationStructureBuildSizesInfoKHR sizes{};
    sizes.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR;
    const auto info = build_info(tree, false, 0);
    device_.functions().vkGetAccelerationStructureBuildSizesKHR(
        device_.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &tree.count, &sizes);
    return sizes;
}

VkDeviceAddress Acceleration::address(const Tree &tree) const {
    VkAccelerationStructureDeviceAddressInfoKHR which{};
    which.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR;
    which.accelerationStructure = tree.structure.get();
    return device_.functions().vkGetAccelerationStructureDeviceAddressKHR(device_.handle(), &which);
}

// Builds the tree of a mesh that keeps its shape, and then makes it as small as it gets.
void Acceleration::build_still(Tree &tree, const arhost_geometry &geometry) {
    if (host_.cancelled())
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while the trees were built");
    const DeviceFunctions &vk = device_.functions();
    const arhost_buffer &positions = geometry.positions;
    const auto *first = arhost::raytracer_common::bytes(arena_) + positions.offset;
    std::vector<Box> sphere_boxes;
    std::span<const std::byte> input(first, std::size_t{positions.stride} * (positions.count - 1) + 12);
    if (geometry.type == ARHOST_GEOMETRY_SPHERES) {
        sphere_boxes = boxes_of(arena_, geometry, {first, positions.stride});
        input = std::as_bytes(std::span(sphere_boxes));
    }
    const Buffer input_buffer(device_, input.size(), tree_input_usage | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                              Buffer::Place::device);
    upload(device_, submission_, input_buffer, {&input, 1});
    if (geometry.type == ARHOST_GEOMETRY_SPHERES)
        tree.geometry.geometry.aabbs.data.deviceAddress = input_buffer.address();
    else
        tree.geometry.geometry.triangles.vertexData.deviceAddress = input_buffer.address();
    tree.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                 VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;

    const auto needed = sizes(tree);
    const VkDeviceSize alignment = device_.physical().tracing.scratch_alignment;
    const Buffer storage(device_, needed.accelerationStructureSize, storage_usage, Buffer::Place::device);
    const Buffer scratch(device_, needed.buildScratchSize + alignment, scratch_usage, Buffer::Place::device);
    create(tree, needed.accelerationStructureSize, {storage.get(), 0});
    VkQueryPoolCreateInfo pool_info{};
    pool_info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
    pool_info.queryType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    pool_info.queryCount = 1;
    const auto pool =
        make<QueryPool, VkQueryPool>(device_, vk.vkCreateQueryPool, pool_info, "asking for a tree's size");

    const VkCommandBuffer commands = submission_.new_commands();
    submission_.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    await_inputs(vk, commands);
    const auto info = build_info(tree, false, aligned(scratch.address(), alignment));
    const VkAccelerationStructureBuildRangeInfoKHR range{tree.count, 0, 0, 0}, *const ranges = &range;
    vk.vkCmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    await_inputs(vk, commands);
    const VkAccelerationStructureKHR large = tree.structure.get();
    vk.vkCmdResetQueryPool(commands, pool.get(), 0, 1);
    vk.vkCmdWriteAccelerationStructuresPropertiesKHR(
        commands, 1, &large, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, pool.get(), 0);
    submission_.end(commands);
    submission_.run(commands);
    VkDeviceSize compacted_size = 0;
    check(vk.vkGetQueryPoolResults(device_.handle(), pool.get(), 0, 1, sizeof compacted_size, &compacted_size,
                                   sizeof compacted_size, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
          "asking for a tree's size");

    const AccelerationStructure whole = std::move(tree.structure);
    create(tree, compacted_size, room(compacted_size));
    submission_.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    await_inputs(vk, commands);
    VkCopyAccelerationStructureInfoKHR copy{};
    copy.sType = VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_INFO_KHR;
    copy.src = whole.get();
    copy.dst = tree.structure.get();
    copy.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
    vk.vkCmdCopyAccelerationStructureKHR(commands, &copy);
    submission_.end(commands);
    submission_.run(commands);
    submission_.free(commands);
}

// Makes the trees of what deforms, the one over the objects, and the commands that build and refit them.
void Acceleration::build_moving() {
    const VkDeviceSize alignment = device_.physical().tracing.scratch_alignment;
    VkDeviceSize scratch_size = 0;
    const auto prepare = [&](Tree &tree) {
        const auto needed = sizes(tree);
        create(tree, needed.accelerationStructureSize, room(needed.accelerationStructureSize));
        tree.scratch_offset = scratch_size;
        tree.scratch_size = std::max(needed.buildScratchSize, needed.updateScratchSize);
        scratch_size = aligned(scratch_size + tree.scratch_size, alignment);
    };
    for (auto &[number, tree] : trees_)
        if (tree.vertices_offset) {
            tree.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                         VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
            tree.geometry.geometry.triangles.vertexData.deviceAddress = moving_.address() + tree.vertices_offset;
            prepare(tree);
        }
    top_.type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    top_.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    top_.count = static_cast<std::uint32_t>(instances_.size());
    top_.geometry = instances(moving_.address());
    prepare(top_);
    scratch_ = Buffer(device_, scratch_size + alignment, scratch_usage, Buffer::Place::device);
    refit_ = submission_.new_commands();
    rebuild_ = submission_.new_commands();
    record_moving(rebuild_, false); // first, as validation layers take it for what happens first
    record_moving(refit_, true);
}

// The tree over the objects is small and always built: a refitted one would decay as they part.
void Acceleration::record_moving(VkCommandBuffer commands, bool refits) const {
    const DeviceFunctions &vk = device_.functions();
    const VkDeviceAddress scratch = aligned(scratch_.address(), device_.physical().tracing.scratch_alignment);
    submission_.begin(commands);
    await_inputs(vk, commands);
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
    for (const auto &[number, tree] : trees_)
        if (tree.vertices_offset) {
            infos.push_back(build_info(tree, refits, scratch + tree.scratch_offset));
            ranges.push_back({tree.count, 0, 0, 0});
        }
    if (!infos.empty()) {
        std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> each(ranges.size());
        std::transform(ranges.begin(), ranges.end(), each.begin(), [](const auto &range) { return &range; });
        vk.vkCmdBuildAccelerationStructuresKHR(commands, static_cast<std::uint32_t>(infos.size()), infos.data(),
                                               each.data());
        await_inputs(vk, commands);
    }
    const auto info = build_info(top_, false, scratch + top_.scratch_offset);
    const VkAccelerationStructureBuildRangeInfoKHR range{top_.count, 0, 0, 0}, *const top_ranges = &range;
    vk.vkCmdBuildAccelerationStructuresKHR(commands, 1, &info, &top_ranges);
    barrier(vk, commands, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR, readers_, VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR);
    submission_.end(commands);
}

void Acceleration::place(std::uint32_t object, const float *m) {
    VkAccelerationStructureInstanceKHR &instance = instances_[object];
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            instance.transform.matrix[row][column] = m[3 * column + row];
    std::memcpy(moving_.mapped().data() + sizeof instance * object, &instance, sizeof instance);
}

VkCommandBuffer Acceleration::move(const arhost_motion &motion) {
    for (std::uint32_t i = 0; i < motion.moved_count; ++i)
        place(motion.moved[i].object, motion.moved[i].world_from_object);
    const auto objects = elements<arhost_object>(arena_, arena_.objects);
    for (std::uint32_t i = 0; i < motion.deformed_count; ++i) {
        const arhost_deformed_geometry &deformed = motion.deformed[i];
        const auto tree = trees_.find(objects[deformed.object].geometry);
        if (tree != trees_.end())
            std::memcpy(moving_.mapped().data() + tree->second.vertices_offset, deformed.positions,
                        3 * sizeof(float) * deformed.vertex_count);
    }
    if (++refits_ <= max_refits)
        return refit_;
    refits_ = 0;
    return rebuild_;
}

} // namespace rt_vulkan
