// SPDX-License-Identifier: Apache-2.0
//
// The scene in the driver's acceleration structures, for the paths `query` and `pipeline`: a bottom-level structure
// for each geometry and a top-level one for the objects. The device builds and updates them.
#pragma once

#include "device.hpp"
#include "layout.hpp"

#include <arhost/motion.h>

#include <map>

namespace rt_vulkan {

// Usage of buffers that structures are built from.
inline constexpr VkBufferUsageFlags build_input_usage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

class AccelerationStructures {
public:
    // `objects` are the scene's, in order; their first_index refers to `indices`. `readers`: the pipeline stages that
    // trace rays. `arena` outlives this.
    AccelerationStructures(const Device &device, const Submission &submission, const arhost_scene &arena,
                           std::span<const Object> objects, const Buffer &indices, VkPipelineStageFlags readers,
                           const arhost::Host &host);

    VkAccelerationStructureKHR top_level() const { return top_level_.handle.get(); }

    // Writes the new positions; the returned commands update the structures and must run before the next image.
    VkCommandBuffer update(const arhost_motion &motion);

private:
    struct Structure {
        VkAccelerationStructureTypeKHR type;
        VkBuildAccelerationStructureFlagsKHR flags;
        VkAccelerationStructureGeometryKHR geometry; // of the top level: the instances
        std::uint32_t count;                         // of triangles, spheres or instances
        AccelerationStructure handle;
        VkDeviceSize scratch_size = 0, scratch_offset = 0;
        std::size_t vertices_offset = 0; // in `moving_`, if it deforms; else 0
    };
    // Storage is suballocated from blocks, as devices allow only some thousand allocations.
    struct Storage {
        VkBuffer buffer;
        VkDeviceSize offset;
    };

    void build_static(Structure &structure, const arhost_geometry &geometry);
    void build_moving();
    void create(Structure &structure, VkDeviceSize size, Storage storage) const;
    VkAccelerationStructureBuildSizesInfoKHR build_sizes(const Structure &structure) const;
    VkAccelerationStructureBuildGeometryInfoKHR build_info(const Structure &structure, bool refits,
                                                           VkDeviceAddress scratch) const;
    VkDeviceAddress address(const Structure &structure) const;
    Storage allocate(VkDeviceSize size);
    void record_moving(VkCommandBuffer commands, bool refits) const;
    void write_instance(std::uint32_t object, const float *world_from_object);

    const Device &device_;
    const Submission &submission_;
    const arhost_scene &arena_;
    arhost::Host host_;
    VkPipelineStageFlags readers_;
    std::vector<Buffer> blocks_;
    VkDeviceSize filled_ = 0;                         // bytes of the last block
    std::map<std::uint32_t, Structure> bottom_level_; // by geometry
    Structure top_level_{};
    Buffer moving_; // written by the host: the instances, then the vertices of deforming meshes
    std::vector<VkAccelerationStructureInstanceKHR> instances_;
    Buffer scratch_;
    VkCommandBuffer refit_ = VK_NULL_HANDLE, rebuild_ = VK_NULL_HANDLE;
    std::uint32_t refits_; // since the last rebuild
};

} // namespace rt_vulkan
