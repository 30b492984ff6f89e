// SPDX-License-Identifier: Apache-2.0
//
// The device's own trees: one over each geometry, and one over the objects. The device builds them, and brings those
// that move to their places.
#pragma once

#include "device.hpp"
#include "layout.hpp"

#include <arhost/motion.h>

#include <map>

namespace rt_vulkan {

// Of a buffer that trees are built from.
inline constexpr VkBufferUsageFlags tree_input_usage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

class Acceleration {
public:
    // `objects` are the scene's, in its order; `indices` is the buffer that their first_index counts in. `readers`:
    // the stages that trace rays. `arena` outlives this.
    Acceleration(const Device &device, const Submission &submission, const arhost_scene &arena,
                 std::span<const Object> objects, const Buffer &indices, VkPipelineStageFlags readers,
                 const arhost::Host &host);

    VkAccelerationStructureKHR top() const { return top_.structure.get(); }

    // Tells where things are now. What is returned brings the trees there, and is to run before the next image.
    VkCommandBuffer move(const arhost_motion &motion);

private:
    struct Tree {
        VkAccelerationStructureTypeKHR type;
        VkBuildAccelerationStructureFlagsKHR flags;
        VkAccelerationStructureGeometryKHR geometry; // or the instances
        std::uint32_t count;                         // of triangles, spheres or instances
        AccelerationStructure structure;
        VkDeviceSize scratch_size = 0, scratch_offset = 0;
        std::size_t vertices_offset = 0; // in `moving_`, where it deforms
    };
    // Memory is handed out in blocks, as devices give but some thousand allocations.
    struct Place {
        VkBuffer buffer;
        VkDeviceSize offset;
    };

    void build_still(Tree &tree, const arhost_geometry &geometry);
    void build_moving();
    void create(Tree &tree, VkDeviceSize size, Place place) const;
    VkAccelerationStructureBuildSizesInfoKHR sizes(const Tree &tree) const;
    VkAccelerationStructureBuildGeometryInfoKHR build_info(const Tree &tree, bool refits,
                                                           VkDeviceAddress scratch) const;
    VkDeviceAddress address(const Tree &tree) const;
    Place room(VkDeviceSize size);
    void record_moving(VkCommandBuffer commands, bool refits) const;
    void place(std::uint32_t object, const float *world_from_object);

    const Device &device_;
    const Submission &submission_;
    const arhost_scene &arena_;
    arhost::Host host_;
    VkPipelineStageFlags readers_;
    std::vector<Buffer> blocks_;
    VkDeviceSize filled_ = 0;             // bytes of the last block
    std::map<std::uint32_t, Tree> trees_; // by geometry
    Tree top_{};
    // What the host writes: the instances, then the vertices that deform.
    Buffer moving_;
    std::vector<VkAccelerationStructureInstanceKHR> instances_;
    Buffer scratch_;
    VkCommandBuffer refit_ = VK_NULL_HANDLE, rebuild_ = VK_NULL_HANDLE;
    std::uint32_t refits_; // since the last building
};

} // namespace rt_vulkan
