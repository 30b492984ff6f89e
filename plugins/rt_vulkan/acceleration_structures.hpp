// SPDX-License-Identifier: Apache-2.0
//
// The Vulkan acceleration structures of a scene, for the paths `query` and `pipeline`: one bottom-level structure per
// geometry, and one top-level structure whose instances are the scene's objects. The device builds and updates them.
#pragma once

#include "device.hpp"
#include "layout.hpp"

#include <arhost/motion.h>

#include <map>

namespace rt_vulkan {

// Usage flags of buffers from which acceleration structures are built.
inline constexpr VkBufferUsageFlags build_input_usage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

class AccelerationStructures {
public:
    // `objects`: the objects of `arena`, in the same order. Their first_index refers to `indices`. `readers`: the
    // pipeline stages that trace rays. `device`, `submission` and `arena` must outlive this object.
    AccelerationStructures(const Device &device, const Submission &submission, const arhost_scene &arena,
                           std::span<const Object> objects, const Buffer &indices, VkPipelineStageFlags readers,
                           const arhost::Host &host);

    VkAccelerationStructureKHR top_level() const { return top_level_.handle.get(); }

    // Writes the new transforms, masks and vertices to host memory. The caller must already have updated `objects`.
    // Returns a command buffer that updates the structures. It must run before the next image is traced.
    VkCommandBuffer update(const arhost_motion &motion, std::span<const Object> objects);

private:
    struct Structure {
        VkAccelerationStructureTypeKHR type;
        VkBuildAccelerationStructureFlagsKHR flags;
        VkAccelerationStructureGeometryKHR geometry; // for the top-level structure: the instances
        std::uint32_t count;                         // number of triangles, spheres or instances
        AccelerationStructure handle;
        VkDeviceSize scratch_size = 0, scratch_offset = 0;
        std::size_t vertices_offset =
            0; // of a deforming mesh's vertices in `moving_`, bytes; 0 if it does not deform
    };
    // The storage of a structure is a part of a larger block, because devices allow only a few thousand allocations.
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
    void write_instance(std::uint32_t object);
    void set_transform(std::uint32_t object, const float *world_from_object);

    const Device &device_;
    const Submission &submission_;
    const arhost_scene &arena_;
    arhost::Host host_;
    VkPipelineStageFlags readers_;
    std::vector<Buffer> blocks_;
    VkDeviceSize filled_ = 0;                         // bytes used in the last block
    std::map<std::uint32_t, Structure> bottom_level_; // key: geometry index
    Structure top_level_{};
    Buffer moving_; // the host writes it: the instances, followed by the vertices of deforming meshes
    std::vector<VkAccelerationStructureInstanceKHR> instances_;
    Buffer scratch_;
    VkCommandBuffer refit_ = VK_NULL_HANDLE, rebuild_ = VK_NULL_HANDLE;
    std::uint32_t refits_; // number of refits since the last rebuild
};

} // namespace rt_vulkan
