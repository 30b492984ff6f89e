// SPDX-License-Identifier: Apache-2.0
#include "renderer.hpp"

#include "raytracer_common/view.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <limits>
#include <mutex>
#include <thread>

namespace rt_vulkan {
namespace {

using arhost::Failure;

static_assert(Bands::unit % group_side == 0); // no band is traced into the next

constexpr Binding moving_bindings[] = {objects_binding, nodes_binding, primitives_binding, attributes_binding};
// Of a still picture: the noise that is left, and what float sums lose, is below half a code. From then on it stays.
constexpr std::uint32_t enough_samples = 1u << 16;
constexpr std::size_t drawn_size = 4 * sizeof(std::int32_t); // shaders/scene.glsl
constexpr std::size_t max_targets = 8;                       // places that images come to again (arhost/raytracer.h)
enum Moment : std::uint32_t { begun, traced, copied, moment_count }; // of the GPU's clock, in an image

std::string mebibytes(std::uint64_t size) {
    return std::to_string((size + (1u << 20) - 1) >> 20) + " MiB";
}

const char *what_is_in(Binding binding) {
    switch (binding) {
    case nodes_binding:
    case primitives_binding:
    case indices_binding:
    case attributes_binding:
        return "the scene's meshes";
    case texels_binding:
        return "the scene's textures";
    case tables_binding:
        return "the scene's environment";
    case rays_binding:
    case history_binding:
    case image_binding:
        return "images of this size";
    default:
        return "the scene's objects, materials or lights";
    }
}

PhysicalDevice checked(const PhysicalDevice &device) {
    if (const std::string why = what_it_lacks(device); !why.empty())
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the Vulkan device '" + device.name + "' " + why + "; choose another with option 'device'");
    return device;
}

// Short beside any watchdog (0.5 s: Linux's v3d and panfrost), long beside what a submission costs (some 0.1 ms).
// There is none on a processor, and lavapipe deals out rows evenly to its threads: the more bands, the more of them
// wait.
std::chrono::milliseconds longest_band(const PhysicalDevice &device) {
    return std::chrono::milliseconds(device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU ? 250 : 100);
}

// Tells the host that a driver is at work, which says nothing itself; but not for ever, as it may hang.
class Heartbeat {
public:
    Heartbeat(const arhost::Host &host, const char *what)
        : thread_([host, what](const std::stop_token &stop) {
              constexpr std::chrono::seconds beat(2), timeout(300);
              std::mutex mutex;
              std::condition_variable_any ended;
              std::unique_lock lock(mutex);
              for (auto passed = std::chrono::seconds(0); passed < timeout && !stop.stop_requested();
                   passed += beat) {
                  host.progress(-1, what);
                  ended.wait_for(lock, stop, beat, [] { return false; });
              }
          }) {}

private:
    std::jthread thread_;
};

} // namespace

Renderer::Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host,
                   const Instance &instance, const PhysicalDevice &physical, const Shaders &shaders)
    : host_(host), settings_(settings),
      intrinsics_((arhost::raytracer_common::check_setup(setup), *setup.intrinsics)),
      stage_(shaders.pipeline_stage()), device_(instance, checked(physical), shaders.path), submission_(device_),
      scene_(*setup.scene, shaders.path == Path::plain, host),
      samples_(arhost::raytracer_common::sample_positions(settings.samples)),
      bands_(intrinsics_.height, settings.longest_band.value_or(longest_band(physical))) {
    make_buffers(intrinsics_, shaders.path);
    if (shaders.path != Path::plain) {
        const Heartbeat heartbeat(host_, "building the trees");
        acceleration_.emplace(device_, submission_, *setup.scene, scene_.objects(), buffers_[indices_binding], stage_,
                              host_);
    }
    make_set(shaders);
    make_pipeline(shaders, setup.scene->max_depth);
    if (host_.cancelled())
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while the shader was compiled");
    if (physical.timestamp_bits) {
        VkQueryPoolCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
        info.queryType = VK_QUERY_TYPE_TIMESTAMP;
        info.queryCount = moment_count;
        clock_ = make<QueryPool, VkQueryPool>(device_, device_.functions().vkCreateQueryPool, info,
                                              "making the GPU's clock");
        // Before all else: trees that are built anew for an image are a part of its time.
        start_clock_ = submission_.new_commands();
        submission_.begin(start_clock_);
        device_.functions().vkCmdResetQueryPool(start_clock_, clock_.get(), 0, moment_count);
        device_.functions().vkCmdWriteTimestamp(start_clock_, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, clock_.get(), begun);
        submission_.end(start_clock_);
    }
    frame_ = scene_.frame();
    frame_.width = intrinsics_.width;
    frame_.height = intrinsics_.height;
    frame_.light_samples = settings.light_samples;
    frame_.one_path = settings.one_path;
    frame_.accumulates = settings.accumulate;
    scene_.forget_still_parts();
}

Buffer Renderer::make_buffer(Binding binding, std::span<const Bytes> parts, std::size_t least_size,
                             VkBufferUsageFlags further_usage) {
    std::size_t size = std::max<std::size_t>(least_size, 16); // none may be empty
    std::size_t filled = 0;
    for (const Bytes &part : parts)
        filled += part.size();
    size = std::max(size, filled);
    const std::uint64_t most = device_.physical().properties.limits.maxStorageBufferRange;
    if (size > most)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, std::string(what_is_in(binding)) + " take " + mebibytes(size) +
                                                           " at once, and the Vulkan device '" +
                                                           device_.physical().name + "' reads " + mebibytes(most) +
                                                           " at most: use smaller ones, another device or rt_embree");
    Buffer buffer(device_, size,
                  VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                      VK_BUFFER_USAGE_TRANSFER_SRC_BIT | further_usage,
                  Buffer::Place::device);
    upload(device_, submission_, buffer, parts);
    return buffer;
}

void Renderer::make_buffers(const arhost_intrinsics &intrinsics, Path path) {
    const bool has_slopes = settings_.samples > 1 || settings_.accumulate;
    const std::size_t pixels = std::size_t{intrinsics.width} * intrinsics.height;
    std::size_t moving_size = 0;
    for (std::uint32_t i = objects_binding; i <= tables_binding; ++i) {
        const auto binding = static_cast<Binding>(i);
        buffers_[binding] = make_buffer(binding, scene_.parts(binding), 0,
                                        binding == indices_binding && path != Path::plain ? tree_input_usage : 0);
        moving_size += scene_.moving_size(binding);
    }
    {
        const RayTable table = make_ray_table(intrinsics, has_slopes);
        ray_dimensions_ = table.dimensions;
        const Bytes part = std::as_bytes(std::span(table.numbers));
        buffers_[rays_binding] = make_buffer(rays_binding, {&part, 1}, 0);
    }
    buffers_[history_binding] = make_buffer(history_binding, {}, settings_.accumulate ? 16 * pixels : 0);
    buffers_[image_binding] = make_buffer(image_binding, {}, 4 * pixels);
    buffers_[drawn_binding] = make_buffer(drawn_binding, {}, drawn_size);
    buffers_[frame_binding] =
        Buffer(device_, sizeof(Frame), VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, Buffer::Place::host_written);
    if (moving_size)
        moving_ = Buffer(device_, moving_size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::staging);
    read_ = Buffer(device_, drawn_size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::host_read);
}

void Renderer::make_set(const Shaders &shaders) {
    const DeviceFunctions &vk = device_.functions();
    constexpr const char *what = "describing the shader's buffers";
    // The device's trees come last, where there are any.
    const std::uint32_t count = binding_count + (acceleration_ ? 1 : 0);
    std::array<VkDescriptorSetLayoutBinding, binding_count + 1> bindings{};
    for (std::uint32_t i = 0; i < count; ++i) {
        bindings[i].binding = i;
        bindings[i].descriptorType = i == frame_binding   ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER
                                     : i == trees_binding ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR
                                                          : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
        bindings[i].descriptorCount = 1;
        bindings[i].stageFlags = shaders.stage_flags();
    }
    VkDescriptorSetLayoutCreateInfo set_info{};
    set_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
    set_info.bindingCount = count;
    set_info.pBindings = bindings.data();
    set_layout_ =
        make<DescriptorSetLayout, VkDescriptorSetLayout>(device_, vk.vkCreateDescriptorSetLayout, set_info, what);
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1},
                                          {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, binding_count - 1},
                                          {VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1}};
    VkDescriptorPoolCreateInfo pool_info{};
    pool_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
    pool_info.maxSets = 1;
    pool_info.poolSizeCount = acceleration_ ? 3 : 2;
    pool_info.pPoolSizes = sizes;
    pool_ = make<DescriptorPool, VkDescriptorPool>(device_, vk.vkCreateDescriptorPool, pool_info, what);
    const VkDescriptorSetLayout layout = set_layout_.get();
    VkDescriptorSetAllocateInfo allocation{};
    allocation.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
    allocation.descriptorPool = pool_.get();
    allocation.descriptorSetCount = 1;
    allocation.pSetLayouts = &layout;
    check(vk.vkAllocateDescriptorSets(device_.handle(), &allocation, &set_), what);
    std::array<VkDescriptorBufferInfo, binding_count> infos{};
    std::array<VkWriteDescriptorSet, binding_count + 1> writes{};
    const VkAccelerationStructureKHR top = acceleration_ ? acceleration_->top() : VK_NULL_HANDLE;
    VkWriteDescriptorSetAccelerationStructureKHR trees{};
    trees.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR;
    trees.accelerationStructureCount = 1;
    trees.pAccelerationStructures = &top;
    for (std::uint32_t i = 0; i < count; ++i) {
        writes[i].sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
        writes[i].dstSet = set_;
        writes[i].dstBinding = i;
        writes[i].descriptorCount = 1;
        writes[i].descriptorType = bindings[i].descriptorType;
        if (i == trees_binding) {
            writes[i].pNext = &trees;
        } else {
            infos[i] = {buffers_[i].get(), 0, VK_WHOLE_SIZE};
            writes[i].pBufferInfo = &infos[i];
        }
    }
    vk.vkUpdateDescriptorSets(device_.handle(), count, writes.data(), 0, nullptr);

    VkPipelineLayoutCreateInfo layout_info{};
    layout_info.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout_info.setLayoutCount = 1;
    layout_info.pSetLayouts = &layout;
    const VkPushConstantRange pushed{shaders.stage_flags(), 0, pushed_size};
    layout_info.pushConstantRangeCount = 1;
    layout_info.pPushConstantRanges = &pushed;
    layout_ = make<PipelineLayout, VkPipelineLayout>(device_, vk.vkCreatePipelineLayout, layout_info, what);
}

void Renderer::make_pipeline(const Shaders &shaders, std::uint32_t max_depth) {
    // Where glass sends two rays on, one waits at each depth.
    const bool branches = scene_.has_glass() && !settings_.one_path;
    const Specialization constants{branches ? static_cast<std::int32_t>(max_depth) + 1 : 1,
                                   scene_.has_glass(),
                                   scene_.has_catchers(),
                                   scene_.has_holes(),
                                   ray_dimensions_,
                                   settings_.samples > 1 || settings_.accumulate,
                                   scene_.has_textures()};
    const Heartbeat heartbeat(host_, "compiling the shader");
    pipeline_.emplace(device_, shaders, layout_.get(), constants);
    // Lavapipe compiles when a shader is first run, and an image must not wait for it: of a frame without width no
    // pixel is traced.
    const VkCommandBuffer commands = submission_.new_commands();
    std::memset(buffers_[frame_binding].mapped().data(), 0, sizeof(Frame));
    submission_.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    pipeline_->record(commands, set_, 1, {0, 1});
    submission_.end(commands);
    submission_.run(commands);
    submission_.free(commands);
}

// The commands for the place that an image goes to. Where memory can't be imported, all share one of ours: then the
// device is not asked again, as one place is like the other.
Renderer::Target &Renderer::target_of(const arhost_image &image) {
    for (Target &target : targets_)
        if (target.rgba == image.rgba && target.stride == image.stride)
            return target;
    Target target;
    if (imports_)
        target.buffer = Buffer::imported(device_, image.rgba, std::size_t{image.stride} * image.height);
    imports_ = static_cast<bool>(target.buffer);
    if (imports_) {
        target.rgba = image.rgba;
        target.stride = image.stride;
    } else {
        for (Target &known : targets_)
            if (!known.rgba)
                return known;
        target.stride = 4 * image.width;
        target.buffer = Buffer(device_, std::size_t{target.stride} * image.height, VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                               Buffer::Place::host_read);
    }
    target.commands = submission_.new_commands();
    if (targets_.size() > max_targets) { // the oldest goes: nothing is under way here
        submission_.free(targets_.front().commands);
        targets_.erase(targets_.begin());
    }
    return targets_.emplace_back(std::move(target));
}

void Renderer::record(Target &target, Rows rows) const {
    if (rows == target.recorded)
        return;
    target.recorded = {};
    submission_.begin(target.commands);
    if (rows.first == 0)
        record_preparation(target.commands);
    else // the part that is drawn is read and widened by all bands
        barrier(device_.functions(), target.commands, stage_, VK_ACCESS_SHADER_WRITE_BIT, stage_,
                VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
    pipeline_->record(target.commands, set_, intrinsics_.width, rows);
    if (rows.first + rows.count == intrinsics_.height)
        record_copy(target);
    submission_.end(target.commands);
    target.recorded = rows;
}

// What moves comes to the device, and nothing is drawn yet.
void Renderer::record_preparation(VkCommandBuffer commands) const {
    const DeviceFunctions &vk = device_.functions();
    VkDeviceSize offset = 0;
    for (const Binding binding : moving_bindings)
        if (const VkDeviceSize size = scene_.moving_size(binding)) {
            const VkBufferCopy copy{offset, 0, size};
            vk.vkCmdCopyBuffer(commands, moving_.get(), buffers_[binding].get(), 1, &copy);
            offset += size;
        }
    const std::int32_t nothing[4] = {std::numeric_limits<std::int32_t>::max(),
                                     std::numeric_limits<std::int32_t>::max(), 0, 0};
    vk.vkCmdUpdateBuffer(commands, buffers_[drawn_binding].get(), 0, drawn_size, nothing);
    barrier(vk, commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT, stage_,
            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
}

void Renderer::record_copy(const Target &target) const {
    const DeviceFunctions &vk = device_.functions();
    const VkCommandBuffer commands = target.commands;
    barrier(vk, commands, stage_, VK_ACCESS_SHADER_WRITE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT,
            VK_ACCESS_TRANSFER_READ_BIT);
    if (clock_.get())
        vk.vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, clock_.get(), traced);
    // Row by row where there is room between them, which stays as it is.
    const VkDeviceSize row = VkDeviceSize{4} * intrinsics_.width;
    std::vector<VkBufferCopy> rows;
    if (target.stride == row)
        rows.push_back({0, 0, row * intrinsics_.height});
    else
        for (std::uint32_t y = 0; y < intrinsics_.height; ++y)
            rows.push_back({row * y, VkDeviceSize{target.stride} * y, row});
    vk.vkCmdCopyBuffer(commands, buffers_[image_binding].get(), target.buffer.get(),
                       static_cast<std::uint32_t>(rows.size()), rows.data());
    const VkBufferCopy drawn{0, 0, drawn_size};
    vk.vkCmdCopyBuffer(commands, buffers_[drawn_binding].get(), read_.get(), 1, &drawn);
    barrier(vk, commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_HOST_BIT,
            VK_ACCESS_HOST_READ_BIT);
    if (clock_.get())
        vk.vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, clock_.get(), copied);
}

void Renderer::record_shader(VkCommandBuffer commands) const {
    pipeline_->record(commands, set_, intrinsics_.width, {0, intrinsics_.height});
}

void Renderer::write_moving_parts() {
    if (!moving_)
        return;
    std::byte *to = moving_.mapped().data();
    for (const Binding binding : moving_bindings)
        if (const std::size_t size = scene_.moving_size(binding)) {
            std::memcpy(to, scene_.parts(binding)[0].data(), size);
            to += size;
        }
}

Rectangle Renderer::render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion) {
    if (!arhost::raytracer_common::same(camera.intrinsics, intrinsics_))
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the camera's intrinsics are not those of start");
    if (image.width != intrinsics_.width || image.height != intrinsics_.height || !image.rgba ||
        image.stride < 4 * image.width || image.stride % 4)
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the image to write is not of the size of start");
    if (host_.cancelled()) // before anything is told of this image
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled before an image was traced");
    Target &target = target_of(image);
    look(camera, frame_);
    std::vector<VkCommandBuffer> commands;
    if (start_clock_)
        commands.push_back(start_clock_);
    if (motion) {
        scene_.move(*motion);
        if (acceleration_)
            commands.push_back(acceleration_->move(*motion));
    }
    if (motion || image_count_ == 0)
        write_moving_parts();

    if (settings_.accumulate) {
        if (motion || !still_camera_ || !arhost::raytracer_common::same_view(*still_camera_, camera))
            history_samples_ = 0;
        still_camera_.reset(); // an image that is not finished has spoilt what was summed up
        samples_ = arhost::raytracer_common::sample_positions(
            history_samples_, history_samples_ < enough_samples ? settings_.samples : 0);
    }
    frame_.first_sample = history_samples_;
    frame_.sample_count = static_cast<std::uint32_t>(samples_.size());
    for (std::size_t i = 0; i < samples_.size(); ++i) {
        frame_.samples[i][0] = samples_[i].x;
        frame_.samples[i][1] = samples_[i].y;
    }
    std::memcpy(buffers_[frame_binding].mapped().data(), &frame_, sizeof frame_);

    trace(std::move(commands), target);
    if (settings_.accumulate) {
        history_samples_ += frame_.sample_count;
        still_camera_ = camera;
    }
    return read_back(target, image);
}

// `commands` come before the image's first band.
void Renderer::trace(std::vector<VkCommandBuffer> commands, Target &target) {
    for (Rows rows{}; rows.first < intrinsics_.height; rows.first += rows.count) {
        if (rows.first > 0 && host_.cancelled())
            throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while an image was traced");
        rows.count = std::min(bands_.rows(), intrinsics_.height - rows.first);
        record(target, rows);
        commands.push_back(target.commands);
        const auto begin = std::chrono::steady_clock::now();
        submission_.run(commands);
        bands_.took(rows.count, std::chrono::steady_clock::now() - begin);
        commands.clear();
    }
}

Rectangle Renderer::read_back(const Target &target, const arhost_image &image) {
    const auto begin = std::chrono::steady_clock::now();
    wrote_in_place_ = target.rgba != nullptr;
    if (!wrote_in_place_)
        for (std::uint32_t y = 0; y < image.height; ++y)
            std::memcpy(image.rgba + std::size_t{image.stride} * y,
                        target.buffer.mapped().data() + std::size_t{target.stride} * y, target.stride);
    read_back_ms_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    ++image_count_;
    last_gpu_ns_ = 0;
    std::uint64_t ticks[moment_count];
    if (clock_.get() &&
        device_.functions().vkGetQueryPoolResults(device_.handle(), clock_.get(), 0, moment_count, sizeof ticks,
                                                  ticks, sizeof *ticks, VK_QUERY_RESULT_64_BIT) == VK_SUCCESS) {
        const auto ms_since = [&](Moment moment) {
            const std::uint32_t bits = device_.physical().timestamp_bits;
            const std::uint64_t passed =
                (ticks[copied] - ticks[moment]) & (bits < 64 ? (std::uint64_t{1} << bits) - 1 : ~std::uint64_t{0});
            return static_cast<double>(passed) * double{device_.physical().properties.limits.timestampPeriod} * 1e-6;
        };
        const double gpu_ms = ms_since(begun);
        last_gpu_ns_ = static_cast<std::uint64_t>(std::llround(1e6 * gpu_ms));
        gpu_ms_ += gpu_ms;
        read_back_ms_ += ms_since(traced);
    }
    std::int32_t drawn[4];
    std::memcpy(drawn, read_.mapped().data(), sizeof drawn);
    if (drawn[0] >= drawn[2])
        return {};
    return {static_cast<std::uint32_t>(drawn[0]), static_cast<std::uint32_t>(drawn[1]),
            static_cast<std::uint32_t>(drawn[2] - drawn[0]), static_cast<std::uint32_t>(drawn[3] - drawn[1])};
}

} // namespace rt_vulkan
