// SPDX-License-Identifier: Apache-2.0
#include "renderer.hpp"

#include "raytracer_common/slow_image.hpp"
#include "raytracer_common/view.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <limits>
#include <mutex>
#include <thread>
#include <utility>

namespace rt_vulkan {
namespace {

using arhost::Failure;
using arhost::raytracer_common::Photon, arhost::raytracer_common::PhotonMap, arhost::raytracer_common::Denoising;
using arhost::raytracer_common::photon_count, arhost::raytracer_common::max_photons;

static_assert(Bands::unit % group_side == 0); // a work group never covers two bands

constexpr Binding moving_bindings[] = {objects_binding, nodes_binding, primitives_binding, attributes_binding,
                                       tables_binding};
constexpr std::size_t drawn_size = 4 * sizeof(std::int32_t); // bytes of the buffer Drawn in shaders/scene.glsl
constexpr std::size_t max_targets = 8; // kept, as the host reuses image memory (arhost/raytracer.h)
enum Timestamp : std::uint32_t { begun, traced, copied, timestamp_count }; // per image

std::string in_mib(std::uint64_t size) {
    return std::to_string((size + (1u << 20) - 1) >> 20) + " MiB";
}

// Returns what a buffer contains, as the subject of an error message.
const char *contents_of(Binding binding) {
    switch (binding) {
    case nodes_binding:
    case primitives_binding:
    case indices_binding:
    case attributes_binding:
        return "the scene's meshes";
    case texels_binding:
        return "the scene's textures";
    case tables_binding:
        return "the scene's environment and emissive meshes";
    case rays_binding:
    case history_binding:
    case image_binding:
        return "images of this size";
    case photons_binding:
        return "the photons";
    default:
        return "the scene's objects, materials or lights";
    }
}

VkDescriptorType descriptor_type(std::uint32_t binding) {
    return binding == frame_binding       ? VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER
           : binding == top_level_binding ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR
                                          : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
}

PhysicalDevice checked(const PhysicalDevice &device) {
    if (const std::string why = missing_requirement(device); !why.empty())
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the Vulkan device '" + device.name + "' " + why + "; choose another with option 'device'");
    return device;
}

bool is_linear(const arhost_raytracer_setup &setup) {
    if (setup.form != ARHOST_IMAGE_FORM_LINEAR)
        return false;
    if (setup.scene->integrator != ARHOST_INTEGRATOR_PATH)
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                      "linear images need a scene with the path integrator; request straight ones");
    return true;
}

std::byte *pixels_of(const arhost_image &image) {
    return image.linear ? reinterpret_cast<std::byte *>(image.linear) : reinterpret_cast<std::byte *>(image.rgba);
}

// Returns the maximum duration of a band. On a GPU, it is far below the shortest watchdog timeout (0.5 s in Linux's
// v3d and panfrost drivers) and far above the overhead of a submission (about 0.1 ms). CPU devices have no watchdog.
// For them, longer bands are better, because lavapipe's threads wait for each other at the end of each band.
std::chrono::milliseconds max_band_time(const PhysicalDevice &device) {
    return std::chrono::milliseconds(device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU ? 250 : 100);
}

std::uint32_t photon_rows(std::uint32_t photons) {
    return (photons + photons_per_row - 1) / photons_per_row;
}

// Returns the size of the buffer of photons in bytes: the photons, and their numbers and starts in each grid.
std::size_t photon_buffer_size(std::size_t count) {
    return count ? sizeof(Photon) * count +
                       sizeof(std::int32_t) * PhotonMap::max_levels * (count + std::bit_ceil(2 * count) + 1)
                 : 0;
}

// Writes the photons and their grids to `to`, and sets the frame's fields of the grids. Returns the number of bytes.
std::size_t write_photons(const PhotonMap &map, std::span<std::byte> to, Frame &frame) {
    std::size_t size = 0;
    const auto write = [&](const auto &part) {
        const Bytes bytes = std::as_bytes(std::span(part));
        std::ranges::copy(bytes, to.subspan(size).begin());
        return static_cast<std::uint32_t>(std::exchange(size, size + bytes.size()) / sizeof(std::uint32_t));
    };
    write(map.photons());
    std::ranges::copy(map.low(), frame.photon_low);
    frame.photon_level_count = static_cast<std::uint32_t>(map.levels().size());
    for (std::size_t i = 0; i < map.levels().size(); ++i) {
        const arhost::raytracer_common::PhotonGrid &grid = map.levels()[i];
        frame.photon_grids[i] = {write(grid.numbers), write(grid.starts),
                                 static_cast<std::uint32_t>(grid.starts.size() - 2), grid.radius};
    }
    return size;
}

// Returns a rectangle from its corners; an empty one if x1 <= x0.
Rectangle rectangle_of(std::int32_t x0, std::int32_t y0, std::int32_t x1, std::int32_t y1) {
    if (x0 >= x1)
        return {};
    return {static_cast<std::uint32_t>(x0), static_cast<std::uint32_t>(y0), static_cast<std::uint32_t>(x1 - x0),
            static_cast<std::uint32_t>(y1 - y0)};
}

// Returns Frame::shown_parts.
std::uint32_t shown_parts(arhost::raytracer_common::View view) {
    using arhost::raytracer_common::View;
    constexpr std::uint32_t shadow = 1, bounce = 2, caustics = 4; // as in shaders/path_catcher.glsl
    switch (view) {
    case View::shadow:
        return shadow;
    case View::bounce:
        return bounce;
    case View::caustics:
        return caustics;
    default:
        return shadow | bounce | caustics;
    }
}

// Reports progress to the host while the driver works, so that the host does not assume a hang. Stops reporting after
// a timeout, because the driver itself may hang.
class Heartbeat {
public:
    Heartbeat(const arhost::Host &host, const char *what)
        : thread_([host, what](const std::stop_token &stop) {
              constexpr std::chrono::seconds interval(2), timeout(300);
              std::mutex mutex;
              std::condition_variable_any ended;
              std::unique_lock lock(mutex);
              for (auto passed = std::chrono::seconds(0); passed < timeout && !stop.stop_requested();
                   passed += interval) {
                  host.progress(-1, what);
                  ended.wait_for(lock, stop, interval, [] { return false; });
              }
          }) {}

private:
    std::jthread thread_;
};

} // namespace

Renderer::Renderer(const arhost_raytracer_setup &setup, const Settings &settings, const arhost::Host &host,
                   const PhysicalDevice &physical, const Shaders &shaders)
    : host_(host), settings_(settings), full_samples_(settings.samples),
      intrinsics_((arhost::raytracer_common::check_setup(setup), *setup.intrinsics)),
      is_path_(setup.scene->integrator == ARHOST_INTEGRATOR_PATH), pixel_size_(is_linear(setup) ? 16 : 4),
      stage_(shaders.pipeline_stage()), device_(checked(physical), shaders.path), submission_(device_),
      scene_(setup, shaders.path == Path::plain, host),
      samples_(arhost::raytracer_common::sample_positions(settings.samples)),
      bands_(intrinsics_.height, settings.max_band_time.value_or(max_band_time(physical))),
      photon_bands_(photon_rows(max_photons), settings.max_band_time.value_or(max_band_time(physical))),
      tap_bands_(intrinsics_.height, settings.max_band_time.value_or(max_band_time(physical))) {
    if (!is_path_ || !scene_.may_have_photons())
        settings_.photons = 0;
    frame_ = scene_.frame();
    frame_.width = intrinsics_.width;
    frame_.height = intrinsics_.height;
    frame_.light_samples = settings.light_samples;
    frame_.single_path = settings.single_path;
    frame_.accumulates = settings.accumulate;
    frame_.max_radiance = settings.max_radiance;
    frame_.is_linear = is_linear(setup);
    frame_.blends_codes = setup.compositing != ARHOST_COMPOSITING_LINEAR;
    set_lens();
    if (settings.denoise && is_path_ && setup.scene->objects.count > Denoising::most_objects)
        host_.info("images are not denoised: the scene has too many objects");
    else if (settings.denoise && is_path_)
        denoiser_.emplace(intrinsics_, setup.scene->objects.count, scene_.has_catchers(), scene_.has_gloss(),
                          scene_.has_specular(), settings.view, settings.denoiser_threads);
    make_buffers(shaders.path);
    if (shaders.path != Path::plain) {
        const Heartbeat heartbeat(host_, "building acceleration structures");
        structures_.emplace(device_, submission_, *setup.scene, scene_.objects(), buffers_[indices_binding], stage_,
                            host_);
    }
    make_descriptor_set(shaders);
    make_pipeline(shaders, setup.scene->max_depth);
    if (host_.cancelled())
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while compiling the shader");
    if (physical.timestamp_bits) {
        const VkQueryPoolCreateInfo info{.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
                                         .queryType = VK_QUERY_TYPE_TIMESTAMP,
                                         .queryCount = timestamp_count};
        timestamps_ = {device_, device_.functions().vkCreateQueryPool, info, "creating the timestamp queries"};
        // These commands are submitted first, so an image's GPU time includes rebuilding acceleration structures.
        start_timestamps_ = submission_.new_commands();
        submission_.begin(start_timestamps_);
        device_.functions().vkCmdResetQueryPool(start_timestamps_, timestamps_.get(), 0, timestamp_count);
        device_.functions().vkCmdWriteTimestamp(start_timestamps_, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT,
                                                timestamps_.get(), begun);
        submission_.end(start_timestamps_);
    }
    preparation_ = submission_.new_commands();
    submission_.begin(preparation_);
    record_preparation(preparation_);
    submission_.end(preparation_);
    photon_commands_ = submission_.new_commands();
    layer_commands_ = submission_.new_commands();
    scene_.release_static_parts();
}

void Renderer::set_samples(std::uint32_t samples, std::uint32_t full_samples) {
    full_samples_ = full_samples;
    if (samples == settings_.samples)
        return;
    if (samples > 1 && !frame_.has_slopes) {
        make_rays(true);
        update_descriptor_set();
    }
    if (make_photon_buffers(samples))
        update_descriptor_set();
    settings_.samples = samples;
    samples_ = arhost::raytracer_common::sample_positions(samples);
    bands_.restart(); // the next image may take much longer than the last one
    history_camera_.reset();
}

void Renderer::set_light_samples(std::uint32_t samples) {
    frame_.light_samples = samples;
    bands_.restart();
    history_camera_.reset();
}

Buffer Renderer::make_buffer(Binding binding, std::span<const Bytes> parts, std::size_t min_size,
                             VkBufferUsageFlags more_usage) {
    std::size_t filled = 0;
    for (const Bytes &part : parts)
        filled += part.size();
    const std::size_t size = std::max({filled, min_size, std::size_t{16}}); // Vulkan does not allow empty buffers
    const std::uint64_t limit = device_.physical().properties.limits.maxStorageBufferRange;
    if (size > limit)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      std::string(contents_of(binding)) + " need a buffer of " + in_mib(size) +
                          ", but the Vulkan device '" + device_.physical().name + "' supports at most " +
                          in_mib(limit) + "; reduce their size, or use another device or rt_embree");
    Buffer buffer(device_, size,
                  VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                      VK_BUFFER_USAGE_TRANSFER_SRC_BIT | more_usage,
                  Buffer::Place::device);
    upload(device_, submission_, buffer, parts);
    return buffer;
}

void Renderer::make_rays(bool has_slopes) {
    const RayTable table = make_ray_table(intrinsics_, has_slopes);
    const Bytes part = std::as_bytes(std::span(table.values));
    buffers_[rays_binding] = make_buffer(rays_binding, {&part, 1}, 0);
    ray_dimensions_ = table.dimensions;
    frame_.has_slopes = has_slopes;
}

// Makes the buffers of photons if they do not exist or are too small. Returns whether it has made them.
bool Renderer::make_photon_buffers(std::uint32_t samples) {
    const std::size_t size = photon_buffer_size(photon_count(settings_.photons, samples));
    if (buffers_[photons_binding] && size <= photons_.size())
        return false;
    Buffer on_device = make_buffer(photons_binding, {}, size);
    if (size)
        photons_ = Buffer(device_, size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                          Buffer::Place::host_read);
    buffers_[photons_binding] = std::move(on_device);
    return true;
}

void Renderer::update_descriptor_set() {
    write_descriptor_set();
    for (Target &target : targets_)
        target.recorded = {}; // the update of the descriptor set invalidates the commands
}

// Returns the size of the planes that the denoiser reads, in bytes.
std::size_t Renderer::layers_size() const {
    return sizeof(std::uint32_t) * LayerDenoiser::plane_count(scene_.has_gloss()) * intrinsics_.width *
           intrinsics_.height;
}

// Makes the buffer of the image or, with denoising, of the planes. Does without denoising if the device has no memory
// for them.
void Renderer::make_image_buffer(std::size_t image_size) {
    if (denoiser_)
        try {
            layers_ = Buffer(device_, layers_size(), VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::host_read);
            buffers_[image_binding] = make_buffer(image_binding, {}, std::max(image_size, layers_size()));
            return;
        } catch (const Failure &failure) {
            denoiser_.reset();
            layers_ = {};
            host_.warn(std::string("images are not denoised: ") + failure.what());
        }
    buffers_[image_binding] = make_buffer(image_binding, {}, image_size);
}

void Renderer::make_buffers(Path path) {
    const std::size_t pixels = std::size_t{intrinsics_.width} * intrinsics_.height;
    std::size_t moving_size = 0;
    for (std::uint32_t i = objects_binding; i <= tables_binding; ++i) {
        const auto binding = static_cast<Binding>(i);
        const std::size_t min_size = binding == texels_binding ? scene_.video_offset() + scene_.video_size() : 0;
        buffers_[binding] = make_buffer(binding, scene_.parts(binding), min_size,
                                        binding == indices_binding && path != Path::plain ? build_input_usage : 0);
        moving_size += scene_.moving_part(binding).size();
    }
    make_rays(settings_.samples > 1 || settings_.accumulate || is_path_);
    make_photon_buffers(settings_.samples);
    buffers_[history_binding] = make_buffer(history_binding, {}, settings_.accumulate ? sizeof(Sums) * pixels : 0);
    make_image_buffer(pixel_size_ * pixels);
    buffers_[drawn_binding] = make_buffer(drawn_binding, {}, drawn_size);
    buffers_[frame_binding] =
        Buffer(device_, sizeof(Frame), VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, Buffer::Place::host_written);
    if (moving_size)
        moving_ = Buffer(device_, moving_size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::staging);
    if (scene_.video_size())
        video_ = Buffer(device_, scene_.video_size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::staging);
    drawn_ = Buffer(device_, drawn_size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::host_read);
}

void Renderer::make_descriptor_set(const Shaders &shaders) {
    const VolkDeviceTable &vk = device_.functions();
    constexpr const char *what = "creating the descriptor set";
    const std::uint32_t count = descriptor_count();
    std::array<VkDescriptorSetLayoutBinding, binding_count + 1> bindings{};
    for (std::uint32_t i = 0; i < count; ++i)
        bindings[i] = {.binding = i,
                       .descriptorType = descriptor_type(i),
                       .descriptorCount = 1,
                       .stageFlags = shaders.stage_flags(),
                       .pImmutableSamplers = nullptr};
    const VkDescriptorSetLayoutCreateInfo set_info{.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
                                                   .bindingCount = count,
                                                   .pBindings = bindings.data()};
    set_layout_ = {device_, vk.vkCreateDescriptorSetLayout, set_info, what};
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1},
                                          {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, binding_count - 1},
                                          {VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1}};
    const VkDescriptorPoolCreateInfo pool_info{.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
                                               .maxSets = 1,
                                               .poolSizeCount = structures_ ? 3u : 2u,
                                               .pPoolSizes = sizes};
    pool_ = {device_, vk.vkCreateDescriptorPool, pool_info, what};
    const VkDescriptorSetLayout layout = set_layout_.get();
    const VkDescriptorSetAllocateInfo allocation{.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
                                                 .descriptorPool = pool_.get(),
                                                 .descriptorSetCount = 1,
                                                 .pSetLayouts = &layout};
    check(vk.vkAllocateDescriptorSets(device_.handle(), &allocation, &set_), what);
    write_descriptor_set();

    const VkPushConstantRange push_constants{shaders.stage_flags(), 0, push_constants_size};
    const VkPipelineLayoutCreateInfo layout_info{.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                                 .setLayoutCount = 1,
                                                 .pSetLayouts = &layout,
                                                 .pushConstantRangeCount = 1,
                                                 .pPushConstantRanges = &push_constants};
    layout_ = {device_, vk.vkCreatePipelineLayout, layout_info, what};
}

void Renderer::write_descriptor_set() {
    const std::uint32_t count = descriptor_count();
    std::array<VkDescriptorBufferInfo, binding_count> infos{};
    std::array<VkWriteDescriptorSet, binding_count + 1> writes{};
    const VkAccelerationStructureKHR top_level = structures_ ? structures_->top_level() : VK_NULL_HANDLE;
    const VkWriteDescriptorSetAccelerationStructureKHR structure{
        .sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR,
        .accelerationStructureCount = 1,
        .pAccelerationStructures = &top_level};
    for (std::uint32_t i = 0; i < count; ++i) {
        writes[i] = {.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
                     .pNext = i == top_level_binding ? &structure : nullptr,
                     .dstSet = set_,
                     .dstBinding = i,
                     .descriptorCount = 1,
                     .descriptorType = descriptor_type(i)};
        if (i != top_level_binding) {
            infos[i] = {buffers_[i].get(), 0, VK_WHOLE_SIZE};
            writes[i].pBufferInfo = &infos[i];
        }
    }
    device_.functions().vkUpdateDescriptorSets(device_.handle(), count, writes.data(), 0, nullptr);
}

void Renderer::make_pipeline(const Shaders &shaders, std::uint32_t max_depth) {
    // If glass spawns two rays, up to one ray per depth waits on the stack. With the path integrator, glossy catchers
    // spawn two rays at the first hit only, and so does glass, unless images are denoised. Translucent surfaces spawn
    // one more.
    const bool mirrors = is_path_ && scene_.has_gloss();
    const bool branches = mirrors || (scene_.has_glass() && (is_path_ || !settings_.single_path));
    const Specialization constants{scene_.blends() ? 2 * static_cast<std::int32_t>(max_depth) + 3
                                   : !branches     ? 1
                                   : is_path_ && !(denoiser_ && scene_.has_glass())
                                       ? 2
                                       : std::max(2, static_cast<std::int32_t>(max_depth) + 1),
                                   scene_.has_glass(),
                                   scene_.has_catchers(),
                                   scene_.has_holes(),
                                   ray_dimensions_,
                                   scene_.has_textures(),
                                   scene_.has_area_lights(),
                                   scene_.video_size() > 0,
                                   mirrors,
                                   settings_.photons > 0,
                                   denoiser_.has_value(),
                                   scene_.has_coat(),
                                   scene_.has_sheen(),
                                   scene_.is_anisotropic(),
                                   scene_.has_film()};
    const Heartbeat heartbeat(host_, "compiling the shader");
    pipeline_.emplace(device_, shaders, layout_.get(), constants);
    if (settings_.photons > 0)
        photon_pipeline_.emplace(device_, photon_shaders_of(shaders.path), layout_.get(), constants);
    if (denoiser_)
        tap_pipeline_.emplace(device_, tap_shaders_of(shaders.path), layout_.get(), constants);
    // Lavapipe compiles a shader when it is first dispatched. Therefore this runs the shaders once for a frame of
    // width 0 and without photons, which traces nothing.
    const VkCommandBuffer commands = submission_.new_commands();
    std::memset(buffers_[frame_binding].mapped().data(), 0, sizeof(Frame));
    submission_.begin(commands, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
    pipeline_->record(commands, set_, 1, {0, 1});
    for (const auto *other : {&photon_pipeline_, &tap_pipeline_})
        if (*other) {
            barrier(device_.functions(), commands, stage_, VK_ACCESS_SHADER_READ_BIT, stage_,
                    VK_ACCESS_SHADER_WRITE_BIT);
            (*other)->record(commands, set_, 1, {0, 1});
        }
    submission_.end(commands);
    submission_.run(commands);
    submission_.free(commands);
}

// Returns the target for an image's memory. After a failed import, tries no further imports; all images then share
// one buffer.
Renderer::Target &Renderer::target_for(const arhost_image &image) {
    for (Target &target : targets_)
        if (target.pixels == pixels_of(image) && target.stride == image.stride)
            return target;
    Target target;
    if (imports_)
        target.buffer = Buffer::imported(device_, pixels_of(image), std::size_t{image.stride} * image.height);
    imports_ = static_cast<bool>(target.buffer);
    if (imports_) {
        target.pixels = pixels_of(image);
        target.stride = image.stride;
    } else {
        for (Target &known : targets_)
            if (!known.pixels)
                return known;
        target.stride = pixel_size_ * image.width;
        target.buffer = Buffer(device_, std::size_t{target.stride} * image.height, VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                               Buffer::Place::host_read);
    }
    target.commands = submission_.new_commands();
    if (targets_.size() > max_targets) { // evict the oldest target, which no pending submission uses
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
    if (rows.first > 0) // all bands read and extend the bounding rectangle of drawn pixels
        barrier(device_.functions(), target.commands, stage_, VK_ACCESS_SHADER_WRITE_BIT, stage_,
                VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
    pipeline_->record(target.commands, set_, intrinsics_.width, rows);
    if (rows.first + rows.count == intrinsics_.height)
        record_copy(target.commands, target.buffer, rows_of(target));
    submission_.end(target.commands);
    target.recorded = rows;
}

// Records commands that upload the moving parts and the video, and reset the bounding rectangle of drawn pixels to
// empty.
void Renderer::record_preparation(VkCommandBuffer commands) const {
    const VolkDeviceTable &vk = device_.functions();
    VkDeviceSize offset = 0;
    for (const Binding binding : moving_bindings)
        if (const VkDeviceSize size = scene_.moving_part(binding).size()) {
            const VkBufferCopy copy{offset, scene_.moving_offset(binding), size};
            vk.vkCmdCopyBuffer(commands, moving_.get(), buffers_[binding].get(), 1, &copy);
            offset += size;
        }
    if (video_) {
        const VkBufferCopy copy{0, scene_.video_offset(), scene_.video_size()};
        vk.vkCmdCopyBuffer(commands, video_.get(), buffers_[texels_binding].get(), 1, &copy);
    }
    const std::int32_t empty[4] = {std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::max(),
                                   0, 0};
    vk.vkCmdUpdateBuffer(commands, buffers_[drawn_binding].get(), 0, drawn_size, empty);
    barrier(vk, commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT, stage_,
            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
}

// Records commands that write rows of the denoiser's layers: with `pipeline_` all but the taps, with `tap_pipeline_`
// these. The last ones also copy the layers to the host.
VkCommandBuffer Renderer::record_layers(const ImagePipeline &pipeline, Rows rows) const {
    submission_.begin(layer_commands_);
    barrier(device_.functions(), layer_commands_, stage_, VK_ACCESS_SHADER_WRITE_BIT, stage_,
            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
    pipeline.record(layer_commands_, set_, intrinsics_.width, rows);
    const VkBufferCopy all{0, 0, layers_.size()};
    if (&pipeline == &*tap_pipeline_ && rows.first + rows.count == intrinsics_.height)
        record_copy(layer_commands_, layers_, {&all, 1});
    submission_.end(layer_commands_);
    return layer_commands_;
}

// Returns the parts of an image that are copied to its target. If the target has padding at the end of rows, copies
// row by row: the padding must not be overwritten.
std::vector<VkBufferCopy> Renderer::rows_of(const Target &target) const {
    const VkDeviceSize row = VkDeviceSize{pixel_size_} * intrinsics_.width;
    if (target.stride == row)
        return {{0, 0, row * intrinsics_.height}};
    std::vector<VkBufferCopy> rows;
    for (std::uint32_t y = 0; y < intrinsics_.height; ++y)
        rows.push_back({row * y, VkDeviceSize{target.stride} * y, row});
    return rows;
}

// Records commands that copy parts of the image's buffer, and the bounding rectangle of drawn pixels, to the host.
void Renderer::record_copy(VkCommandBuffer commands, const Buffer &to, std::span<const VkBufferCopy> regions) const {
    const VolkDeviceTable &vk = device_.functions();
    barrier(vk, commands, stage_, VK_ACCESS_SHADER_WRITE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT,
            VK_ACCESS_TRANSFER_READ_BIT);
    if (timestamps_.get())
        vk.vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, timestamps_.get(), traced);
    vk.vkCmdCopyBuffer(commands, buffers_[image_binding].get(), to.get(), static_cast<std::uint32_t>(regions.size()),
                       regions.data());
    const VkBufferCopy drawn{0, 0, drawn_size};
    vk.vkCmdCopyBuffer(commands, buffers_[drawn_binding].get(), drawn_.get(), 1, &drawn);
    barrier(vk, commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_HOST_BIT,
            VK_ACCESS_HOST_READ_BIT);
    if (timestamps_.get())
        vk.vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, timestamps_.get(), copied);
}

// Records commands that trace rows of photons. The last ones also copy all photons to the host.
void Renderer::record_photons(Rows rows, bool is_last) const {
    const VolkDeviceTable &vk = device_.functions();
    submission_.begin(photon_commands_);
    photon_pipeline_->record(photon_commands_, set_, photons_per_row, rows);
    if (is_last) {
        barrier(vk, photon_commands_, stage_, VK_ACCESS_SHADER_WRITE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT,
                VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_TRANSFER_WRITE_BIT);
        const VkBufferCopy copy{0, 0, sizeof(Photon) * frame_.photon_count};
        vk.vkCmdCopyBuffer(photon_commands_, buffers_[photons_binding].get(), photons_.get(), 1, &copy);
        barrier(vk, photon_commands_, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT,
                VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT | VK_ACCESS_HOST_WRITE_BIT);
    }
    submission_.end(photon_commands_);
}

// Records commands that give the map of the photons to the device. `size`: bytes.
void Renderer::record_photon_map(std::size_t size) const {
    const VolkDeviceTable &vk = device_.functions();
    submission_.begin(photon_commands_);
    const VkBufferCopy copy{0, 0, size};
    vk.vkCmdCopyBuffer(photon_commands_, photons_.get(), buffers_[photons_binding].get(), 1, &copy);
    barrier(vk, photon_commands_, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT, stage_,
            VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
    submission_.end(photon_commands_);
}

void Renderer::record_shader(VkCommandBuffer commands) const {
    pipeline_->record(commands, set_, intrinsics_.width, {0, intrinsics_.height});
}

void Renderer::write_moving_parts() {
    if (!moving_)
        return;
    std::byte *to = moving_.mapped().data();
    for (const Binding binding : moving_bindings)
        if (const Bytes part = scene_.moving_part(binding); !part.empty())
            to = std::ranges::copy(part, to).out;
}

// Sets the fields of the frame with which the path integrator finds the pixel of the video in a direction.
void Renderer::set_lens() {
    frame_.focal_length[0] = static_cast<float>(intrinsics_.fx);
    frame_.focal_length[1] = static_cast<float>(intrinsics_.fy);
    frame_.principal_point[0] = static_cast<float>(intrinsics_.cx);
    frame_.principal_point[1] = static_cast<float>(intrinsics_.cy);
    frame_.distortion = static_cast<std::uint32_t>(intrinsics_.distortion);
    std::copy_n(intrinsics_.coefficients, intrinsics_.coefficient_count, frame_.lens);
    frame_.max_radius_squared = arhost::raytracer_common::max_radius_squared(intrinsics_);
}

void Renderer::set_video(const arhost_frame *video) {
    frame_.has_video =
        video_ && video && video->format->width == intrinsics_.width && video->format->height == intrinsics_.height;
    if (frame_.has_video) {
        video_image_.set(*video);
        std::memcpy(video_.mapped().data(), video_image_.texels(), scene_.video_size());
    }
    const arhost::raytracer_common::VideoImage *known = frame_.has_video ? &video_image_ : nullptr;
    std::ranges::copy(arhost::raytracer_common::environment_scale(scene_.environment(), known),
                      frame_.environment_intensity);
    if (is_path_)
        frame_.least_irradiance = scene_.lights().least_irradiance(known);
}

Rectangle Renderer::render(const arhost_camera &camera, const arhost_image &image, const arhost_motion *motion,
                           const arhost_frame *video, std::uint64_t sequence,
                           const LayerDenoiser::StateSlots &state) {
    arhost::raytracer_common::check_render(camera, image, intrinsics_);
    if (!image.linear == (frame_.is_linear != 0))
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT, "the image buffer must have the form passed to start");
    if (image.stride % 4)
        throw Failure(ARHOST_STATUS_ERROR_INVALID_ARGUMENT,
                      "the image buffer's stride must be a multiple of 4 bytes");
    if (host_.cancelled()) // checked before the scene is updated
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled before tracing the image");
    set_camera(camera, frame_);
    std::vector<VkCommandBuffer> commands;
    if (start_timestamps_)
        commands.push_back(start_timestamps_);
    if (motion) {
        scene_.update(*motion);
        if (is_path_)
            scene_.write_lights(frame_);
        if (structures_)
            commands.push_back(structures_->update(*motion, scene_.objects()));
    }
    if (motion || image_count_ == 0)
        write_moving_parts();
    commands.push_back(preparation_);
    set_video(video);

    if (settings_.accumulate) {
        if (motion || !history_camera_ || !arhost::raytracer_common::same_view(*history_camera_, camera))
            history_samples_ = 0;
        history_camera_.reset(); // stays empty if this image fails, as the sums are then invalid
        samples_ = arhost::raytracer_common::sample_positions(
            history_samples_,
            history_samples_ < arhost::raytracer_common::max_accumulated_samples ? settings_.samples : 0);
    }
    frame_.first_sample = frame_.first_random = history_samples_;
    if (is_path_ && !settings_.accumulate) { // the random numbers of successive frames continue one sequence
        frame_.first_random = static_cast<std::uint32_t>(sequence) * full_samples_;
        samples_ = arhost::raytracer_common::sample_positions(frame_.first_random % (1u << 16), settings_.samples);
    }
    frame_.sample_count = static_cast<std::uint32_t>(samples_.size());
    frame_.ray_angle = is_path_ ? arhost::raytracer_common::ray_angle(intrinsics_, samples_.size()) : 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
        frame_.samples[i][0] = samples_[i].x;
        frame_.samples[i][1] = samples_[i].y;
    }

    const bool denoises = denoiser_ && state.after;
    frame_.denoises = denoises;
    frame_.shown_parts = shown_parts(denoises ? settings_.view : arhost::raytracer_common::View::picture);
    if (denoises)
        begin_denoising(state, image, motion, sequence);
    arhost::raytracer_common::SlowImage slow_image(host_);
    trace_photons(commands, [&](double) { slow_image.report(0); });
    write_frame();
    const auto report = [&](double fraction) { slow_image.report(fraction); };
    if (denoises) {
        trace(
            std::move(commands), intrinsics_.height, bands_,
            [&](Rows rows) { return record_layers(*pipeline_, rows); }, report);
        check_cancelled();
        trace(
            {}, intrinsics_.height, tap_bands_, [&](Rows rows) { return record_layers(*tap_pipeline_, rows); },
            [&](double) { report(1); });
        check_cancelled();
        read_timestamps();
        const auto drawn = denoiser_->run(reinterpret_cast<const std::uint32_t *>(layers_.mapped().data()));
        return rectangle_of(drawn.x0, drawn.y0, drawn.x1, drawn.y1);
    }
    Target &target = target_for(image);
    const auto commands_of = [&](Rows rows) {
        record(target, rows);
        return target.commands;
    };
    trace(std::move(commands), intrinsics_.height, bands_, commands_of, report);
    if (settings_.accumulate) {
        history_samples_ += frame_.sample_count;
        history_camera_ = camera;
    }
    return read_back(target, image);
}

void Renderer::begin_denoising(const LayerDenoiser::StateSlots &state, const arhost_image &image,
                               const arhost_motion *motion, std::uint64_t sequence) {
    arhost::raytracer_common::Camera camera;
    std::copy_n(frame_.eye, 3, camera.eye);
    for (std::size_t i = 0; i < 3; ++i)
        std::copy_n(frame_.world_from_camera[i], 3, camera.world_from_camera + 3 * i);
    const Denoising &denoising = denoiser_->begin(state, {.camera = camera,
                                                          .video = frame_.has_video ? &video_image_ : nullptr,
                                                          .image = image,
                                                          .blends_codes = frame_.blends_codes != 0,
                                                          .objects = scene_.placed_objects(),
                                                          .deforms = motion && motion->deformed_count > 0,
                                                          .sequence = static_cast<std::uint32_t>(sequence),
                                                          .samples = full_samples_});
    frame_.seen_moves = denoising.seen_moves();
    frame_.pixel_angle = denoising.pixel_angle;
}

void Renderer::check_cancelled() const {
    if (host_.cancelled())
        throw Failure(ARHOST_STATUS_ERROR_CANCELLED, "cancelled while tracing the image");
}

void Renderer::write_frame() {
    std::memcpy(buffers_[frame_binding].mapped().data(), &frame_, sizeof frame_);
}

// Traces rows of pixels or photons band by band. `commands` run before the first band. record(rows) returns the
// commands of a band, report(fraction) reports progress.
void Renderer::trace(std::vector<VkCommandBuffer> commands, std::uint32_t row_count, Bands &bands,
                     const std::function<VkCommandBuffer(Rows)> &record, const std::function<void(double)> &report) {
    for (Rows rows{}; rows.first < row_count; rows.first += rows.count) {
        const auto waiting = [&] { report(static_cast<double>(rows.first) / row_count); };
        waiting();
        if (rows.first > 0)
            check_cancelled();
        rows.count = std::min(bands.rows(), row_count - rows.first);
        commands.push_back(record(rows));
        const auto begin = std::chrono::steady_clock::now();
        submission_.run(commands, waiting);
        bands.record(rows.count, std::chrono::steady_clock::now() - begin);
        commands.clear();
    }
}

// Sends photons from the lamps to mirrors and glass, and sorts those that arrive on other surfaces. `commands` run
// before; afterwards, it contains the commands that are to run before the image.
void Renderer::trace_photons(std::vector<VkCommandBuffer> &commands, const std::function<void(double)> &report) {
    frame_.photon_level_count = 0;
    frame_.photon_count = scene_.photon_targets().empty() ? 0 : photon_count(settings_.photons, frame_.sample_count);
    frame_.first_photon = frame_.first_random * settings_.photons;
    if (frame_.photon_count == 0)
        return;
    write_frame();
    const std::uint32_t row_count = photon_rows(frame_.photon_count);
    const auto commands_of = [&](Rows rows) {
        record_photons(rows, rows.first + rows.count == row_count);
        return photon_commands_;
    };
    trace(std::exchange(commands, {}), row_count, photon_bands_, commands_of, report);
    check_cancelled();
    photon_map_.build({reinterpret_cast<const Photon *>(photons_.mapped().data()), frame_.photon_count});
    check_cancelled();
    if (const std::size_t size = write_photons(photon_map_, photons_.mapped(), frame_)) {
        record_photon_map(size);
        commands.push_back(photon_commands_);
    }
}

Rectangle Renderer::read_back(const Target &target, const arhost_image &image) {
    const auto begin = std::chrono::steady_clock::now();
    wrote_in_place_ = target.pixels != nullptr;
    if (!wrote_in_place_)
        for (std::uint32_t y = 0; y < image.height; ++y)
            std::memcpy(pixels_of(image) + std::size_t{image.stride} * y,
                        target.buffer.mapped().data() + std::size_t{target.stride} * y, target.stride);
    read_back_ms_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    read_timestamps();
    std::int32_t drawn[4];
    std::memcpy(drawn, drawn_.mapped().data(), sizeof drawn);
    return rectangle_of(drawn[0], drawn[1], drawn[2], drawn[3]);
}

// Reads the GPU times of an image, and counts it.
void Renderer::read_timestamps() {
    ++image_count_;
    last_gpu_ns_ = 0;
    std::uint64_t ticks[timestamp_count];
    if (timestamps_.get() && device_.functions().vkGetQueryPoolResults(
                                 device_.handle(), timestamps_.get(), 0, timestamp_count, sizeof ticks, ticks,
                                 sizeof *ticks, VK_QUERY_RESULT_64_BIT) == VK_SUCCESS) {
        const auto ms_since = [&](Timestamp start) {
            const std::uint32_t bits = device_.physical().timestamp_bits;
            const std::uint64_t elapsed =
                (ticks[copied] - ticks[start]) & (bits < 64 ? (std::uint64_t{1} << bits) - 1 : ~std::uint64_t{0});
            return static_cast<double>(elapsed) * double{device_.physical().properties.limits.timestampPeriod} * 1e-6;
        };
        const double gpu_ms = ms_since(begun);
        last_gpu_ns_ = static_cast<std::uint64_t>(std::llround(1e6 * gpu_ms));
        gpu_ms_ += gpu_ms;
        read_back_ms_ += ms_since(traced);
    }
}

} // namespace rt_vulkan
