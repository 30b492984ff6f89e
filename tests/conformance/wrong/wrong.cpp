// SPDX-License-Identifier: Apache-2.0
// All wrong ray tracers: rt_embree with a defect that this library's file name selects. For example, a link
// rt_bgra.so swaps red and blue. Other names select no defect.
#include "defect.hpp"

#include <arhost/arhost.h>
#include <arhost/shading/srgb8.hpp>
#include <directories.hpp>
#include <pixels/linear.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace {

namespace shading = arhost::shading;
using arhost::LinearPixel;
using namespace arhost::test;

// ---- The modified ray tracer ------------------------------------------------------------------------

struct AtEnds {
    AtEnds() {
        if (has("crash_in_constructor"))
            crash();
    }
    ~AtEnds() {
        if (has("crash_at_exit"))
            crash();
    }
} at_ends;

const arhost_plugin &embree() {
    static const arhost_plugin &plugin = open_plugin(arhost::test::plugin_directory() + "/rt_embree.so");
    return plugin;
}
const arhost_raytracer &embree_functions() {
    return *static_cast<const arhost_raytracer *>(embree().functions);
}

using SceneCopy = std::unique_ptr<std::byte, decltype(&std::free)>;

struct Wrong {
    arhost_instance *real = nullptr;
    const arhost_host *host = nullptr;
    bool was_started = false, is_tiny = false;
    unsigned users = 0;
    std::uint32_t max_samples = 0;        // of an earlier request
    std::uint32_t shading_px = 0;         // likewise
    std::uint32_t images = 0;             // rendered so far
    std::uint32_t width = 0;              // of the setup
    std::int64_t threads = 0;             // the option
    std::vector<std::uint8_t> last;       // image
    std::vector<std::uint8_t> last_video; // plane 0 of the previous request's video
    arhost_frame_format last_format{};    // of the previous request's video
    SceneCopy scene{nullptr, &std::free}; // modified
    // Defects that combine two images: renders the other one, of another scene and with `fineness` times as many
    // pixels along each axis.
    arhost_instance *other = nullptr;
    SceneCopy other_scene{nullptr, &std::free};
    std::uint32_t fineness = 1;
};
Wrong &wrong(arhost_instance *instance) {
    return *reinterpret_cast<Wrong *>(instance);
}

// ---- Modified input ----------------------------------------------------------------------------------

arhost_intrinsics modify(arhost_intrinsics in) {
    if (has("pixel_centres_at_half")) {
        in.cx += 0.5;
        in.cy += 0.5;
    }
    if (has("focal_1_percent"))
        in.fx *= 1.01, in.fy *= 1.01;
    if (has("fx_as_fy"))
        in.fy = in.fx;
    if (has("centred_principal_point")) {
        in.cx = (in.width - 1) / 2.0;
        in.cy = (in.height - 1) / 2.0;
    }
    if (has("no_lens")) {
        in.distortion = ARHOST_DISTORTION_NONE;
        in.coefficient_count = 0;
    }
    if (has("tangential_swapped") && in.distortion == ARHOST_DISTORTION_BROWN)
        std::swap(in.coefficients[2], in.coefficients[3]);
    return in;
}

arhost_camera modify(arhost_camera camera) {
    camera.intrinsics = modify(camera.intrinsics);
    if (has("flipped_z"))
        for (double *vector : {camera.eye, camera.look_at, camera.up})
            vector[2] = -vector[2];
    if (has("metres"))
        for (double *vector : {camera.eye, camera.look_at})
            std::for_each_n(vector, 3, [](double &x) { x /= 1000; });
    if (has("look_at_as_direction"))
        for (int i = 0; i < 3; ++i)
            camera.look_at[i] += camera.eye[i];
    if (has("far_clip_at_100_m"))
        camera.eye[2] = std::min(camera.eye[2], 1e5);
    if (has("ignores_up")) {
        const std::array<double, 3> y = {0, 1, 0};
        std::copy(y.begin(), y.end(), camera.up);
    }
    return camera;
}

// ---- Modified output ---------------------------------------------------------------------------------

struct Pixels {
    const arhost_image &image;
    std::uint8_t *at(std::uint32_t x, std::uint32_t y) const {
        return image.rgba + std::size_t{image.stride} * y + std::size_t{4} * x;
    }
    template <class Function> void each(Function &&function) const {
        for (std::uint32_t y = 0; y < image.height; ++y)
            for (std::uint32_t x = 0; x < image.width; ++x)
                function(at(x, y));
    }
    void replace_alpha(int from, int to) const {
        each([&](std::uint8_t *p) { p[3] = p[3] == from ? static_cast<std::uint8_t>(to) : p[3]; });
    }
    template <class Function> void each_colour(Function &&function) const {
        each([&](std::uint8_t *p) {
            for (int channel = 0; channel < 3; ++channel)
                p[channel] = static_cast<std::uint8_t>(std::lround(255 * function(p[channel] / 255.0, p[3] / 255.0)));
        });
    }
};

void modify(const Pixels &pixels) {
    const arhost_image &image = pixels.image;
    if (has("miss_alpha_1"))
        pixels.replace_alpha(0, 1);
    if (has("opaque_background"))
        pixels.replace_alpha(0, 255);
    if (has("hit_alpha_254"))
        pixels.replace_alpha(255, 254);
    if (has("shadow_alpha_154"))
        pixels.replace_alpha(153, 154);
    if (has("glass_casts_opaque_shadows"))
        pixels.replace_alpha(77, 153);
    if (has("ignores_shadow_alphas")) {
        pixels.replace_alpha(204, 153);
        pixels.replace_alpha(51, 77);
    }
    if (has("no_shadows"))
        pixels.each([](std::uint8_t *p) { p[3] = p[3] == 255 ? 255 : 0; });
    if (has("green_shadows"))
        pixels.each([](std::uint8_t *p) { p[1] = p[3] == 153 || p[3] == 77 ? 30 : p[1]; });
    if (has("bgra"))
        pixels.each([](std::uint8_t *p) { std::swap(p[0], p[2]); });
    if (has("premultiplied"))
        pixels.each_colour([](double colour, double alpha) { return colour * alpha; });
    if (has("dark"))
        pixels.each_colour([](double colour, double) { return 0.8 * colour; });
    if (has("mixed_with_white"))
        pixels.each_colour([](double colour, double) { return colour > 0 ? 0.5 + 0.5 * colour : 0; });
    if (has("linear_codes"))
        pixels.each_colour([](double colour, double) { return std::pow(colour, 2.2); });
    if (has("gamma_2_2"))
        pixels.each_colour([](double c, double) {
            return std::pow(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4), 1 / 2.2);
        });
    if (has("flipped_rows"))
        for (std::uint32_t y = 0; y < image.height / 2; ++y)
            std::swap_ranges(pixels.at(0, y), pixels.at(0, y) + std::size_t{4} * image.width,
                             pixels.at(0, image.height - 1 - y));
    if (has("mirrored_columns"))
        for (std::uint32_t y = 0; y < image.height; ++y)
            for (std::uint32_t x = 0; x < image.width / 2; ++x)
                std::swap_ranges(pixels.at(x, y), pixels.at(x, y) + 4, pixels.at(image.width - 1 - x, y));
    if (has("writes_past_end"))
        std::memset(pixels.at(0, image.height - 1) + image.stride, 0, 4);
    if (has("writes_before_start"))
        image.rgba[-1] = 0;
    if (has("writes_padding"))
        for (std::uint32_t y = 0; y < image.height; ++y)
            std::memset(pixels.at(image.width, y), 0, 4);
}

// A linear image.
struct LinearPixels {
    const arhost_image &image;
    LinearPixel &at(std::uint32_t x, std::uint32_t y) const {
        return reinterpret_cast<LinearPixel *>(image.linear + std::size_t{image.stride} / 2 * y)[x];
    }
    template <class Function> void each(Function &&function) const {
        for (std::uint32_t y = 0; y < image.height; ++y)
            for (std::uint32_t x = 0; x < image.width; ++x)
                function(at(x, y));
    }
};

bool is_miss(const LinearPixel &p) {
    return p == arhost::untouched;
}
bool is_hit(const LinearPixel &p) {
    return p.transmittance[1] == 0 && p.added[1] != 0;
}
bool is_edge(const LinearPixel &p) {
    return p.transmittance[1] != 0 && p.added[1] != 0;
}
bool is_changed_catcher(const LinearPixel &p) {
    return p.added[1] == 0 && !is_miss(p);
}

void modify(const LinearPixels &pixels) {
    using arhost::float_of, arhost::half_of, arhost::half_of_one;
    const arhost_image &image = pixels.image;
    const auto change = [&](const char *defect, bool (*applies)(const LinearPixel &), auto function) {
        if (has(defect))
            pixels.each([&](LinearPixel &p) {
                if (applies(p))
                    function(p);
            });
    };
    const auto change_added = [&](const char *defect, bool (*applies)(const LinearPixel &), auto function) {
        change(defect, applies, [&](LinearPixel &p) {
            for (std::uint16_t &added : p.added)
                added = half_of(function(float_of(added), float_of(p.transmittance[1])));
        });
    };
    change("darkens_misses", is_miss, [](LinearPixel &p) { p.transmittance[1] = half_of_one - 1; });
    change("nan_on_catchers", is_changed_catcher, [](LinearPixel &p) { p.transmittance[1] = 0x7e00; });
    change("infinite_on_catchers", is_changed_catcher, [](LinearPixel &p) { p.transmittance[1] = 0x7c00; });
    change("negative_zero", is_changed_catcher, [](LinearPixel &p) { p.added[1] = 0x8000; });
    change("alpha_in_linear_images", is_hit, [](LinearPixel &p) { p.reserved_0 = half_of_one; });
    change("transmits_through_objects", is_hit, [](LinearPixel &p) { p.transmittance[1] = 1; });
    change("brightens_at_edges", is_edge, [](LinearPixel &p) { p.transmittance[1] = half_of_one + 1; });
    change("grey_shadows", is_changed_catcher, [](LinearPixel &p) {
        const auto &[r, g, b] = p.transmittance;
        std::fill_n(p.transmittance, 3, half_of((float_of(r) + float_of(g) + float_of(b)) / 3));
    });
    change("no_bounce_onto_catchers", is_changed_catcher, [](LinearPixel &p) {
        for (std::uint16_t &transmittance : p.transmittance)
            transmittance = std::min(transmittance, half_of_one);
    });
    change_added("added_at_most_1", is_hit, [](float added, float) { return std::min(added, 1.0f); });
    change_added("dark_linear_images", is_hit, [](float added, float) { return 0.8f * added; });
    change_added("added_not_weighted", is_edge,
                 [](float added, float transmittance) { return added / (1 - std::min(transmittance, 0.9f)); });
    if (has("random_linear_images")) {
        static std::atomic<unsigned> images{0};
        const unsigned noise = images++ & 1;
        pixels.each([&](LinearPixel &p) {
            if (is_hit(p))
                p.added[1] = static_cast<std::uint16_t>(p.added[1] ^ noise);
        });
    }
    if (has("writes_linear_padding"))
        for (std::uint32_t y = 0; y < image.height; ++y)
            pixels.at(image.width, y) = {};
}

void modify(arhost_render_info &info, const arhost_image &image) {
    if (has("region_too_narrow") && info.region_width > 4)
        info.region_width -= 4;
    if (has("region_beyond_image"))
        info.region_width = image.width + 1;
    if (has("coarse_edges") || has("ignores_shading_px") || has("keeps_shading_px"))
        info.coarsest_shading_px = 2;
}

// ---- The plugin --------------------------------------------------------------------------------------

Wrong *existing = nullptr; // for one_instance

// Starts a process in a new session, reparented to the subreaper.
void start_a_process() {
    if (::fork() != 0)
        return;
    ::setsid();
    if (::fork() != 0)
        ::_exit(0);
    ::dprintf(STDERR_FILENO, "process %d\n", ::getpid());
    hang();
}

arhost_status create(const arhost_host *host, const arhost_option *options, std::uint32_t count,
                     arhost_instance **instance) {
    misbehave_in("create");
    if (has("hangs_with_child_process")) {
        start_a_process();
        hang();
    }
    if (std::getenv("ARHOST_LIST_DESCRIPTORS"))
        for (const auto &entry : std::filesystem::directory_iterator("/proc/self/fd")) {
            std::error_code closed; // the directory's descriptor
            ::dprintf(STDERR_FILENO, "%s is %s\n", entry.path().filename().c_str(),
                      std::filesystem::read_symlink(entry, closed).c_str());
        }
    if (has("writes_to_descriptor_3"))
        (void)!::write(3, "{}\n", 3);
    if (has("forges_verdict")) {
        constexpr std::string_view result =
            R"({"test": "abi.create", "verdict": "brilliant", "message": "", "seconds": 0,)"
            R"( "facts": {}, "images": []})"
            "\n";
        (void)!::write(3, result.data(), result.size());
        ::_exit(0);
    }
    if (has("rejects_unknown_options") && count > embree().descriptor->option_count) {
        host->log(host, ARHOST_SEVERITY_ERROR, "unknown option");
        return ARHOST_STATUS_ERROR_CONFIGURATION;
    }
    if (has("floods_descriptor_3"))
        for (const std::vector<char> zeros(1 << 16, '0');;)
            (void)!::write(3, zeros.data(), zeros.size());
    if (has("no_instance"))
        return ARHOST_STATUS_OK;
    if (has("create_fails")) {
        host->log(host, ARHOST_SEVERITY_ERROR, "no\x1b[2J\n\xff<&");
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    }
    if (has("needs_an_extension") && *static_cast<const int *>(host->get_extension(host, "arhost.host.depth/1")) == 0)
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    if (has("leaks_memory"))
        leak_memory(1 << 18);
    if (has("leaks_descriptors"))
        (void)::dup(0);
    if (has("leaves_a_thread"))
        std::thread(hang).detach();
    if (has("cancelled_create_is_internal") && host->cancelled(host))
        return ARHOST_STATUS_ERROR_INTERNAL;
    if (has("one_instance") && existing) {
        ++existing->users;
        *instance = reinterpret_cast<arhost_instance *>(existing);
        return ARHOST_STATUS_OK;
    }
    auto *created = new Wrong;
    const arhost_status status = embree().create(host, options, count, &created->real);
    std::vector<arhost_option> of_other;
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto *bytes = reinterpret_cast<const std::byte *>(options) + std::size_t{options->struct_size} * i;
        arhost_option &option = of_other.emplace_back(*reinterpret_cast<const arhost_option *>(bytes));
        option.struct_size = sizeof option;
        if ((has("averages_codes") || has("clamps_samples")) && option.key == std::string_view("samples") &&
            option.integer > 1)
            option.integer = 1, created->fineness = 4;
    }
    if (has("adds_shadows") || has("blends_linearly") || has("facets_in_shadow") || created->fineness > 1)
        embree().create(host, of_other.data(), count, &created->other);
    created->host = host;
    created->users = 1;
    created->threads = arhost_find_option(options, count, "threads")->integer;
    if (has("ignores_struct_size"))
        for (std::uint32_t i = 0; i < count; ++i)
            if (options[i].key == std::string_view("threads"))
                created->threads = options[i].integer;
    existing = created;
    *instance = reinterpret_cast<arhost_instance *>(created);
    return status;
}

void destroy(arhost_instance *instance) {
    misbehave_in("destroy");
    Wrong &self = wrong(instance);
    if (--self.users > 0)
        return;
    embree().destroy(self.real);
    if (self.other)
        embree().destroy(self.other);
    existing = nullptr;
    delete &self;
}

template <class T> std::span<const T> view(const arhost_scene &scene, const arhost_buffer &buffer) {
    return {reinterpret_cast<const T *>(reinterpret_cast<const std::byte *>(&scene) + buffer.offset), buffer.count};
}
bool has_degenerate_triangle(const arhost_scene &scene) {
    using Triangle = std::array<std::uint32_t, 3>;
    for (const auto &geometry : view<arhost_geometry>(scene, scene.geometries))
        for (const Triangle &t : view<Triangle>(scene, geometry.indices))
            if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
                return true;
    return false;
}

SceneCopy make_copy(const arhost_scene &scene) {
    SceneCopy copy(static_cast<std::byte *>(std::aligned_alloc(64, (scene.byte_size + 63) / 64 * 64)), &std::free);
    std::memcpy(copy.get(), &scene, scene.byte_size);
    return copy;
}
arhost_scene &scene_in(const SceneCopy &copy) {
    return *reinterpret_cast<arhost_scene *>(copy.get());
}

// A sphere is less than a millimetre in front of the camera.
bool is_near(const Wrong &self, const arhost_camera &camera) {
    const arhost_scene &scene = scene_in(self.scene);
    for (const auto &geometry : view<arhost_geometry>(scene, scene.geometries))
        if (geometry.type == ARHOST_GEOMETRY_SPHERES)
            for (const auto &s : view<std::array<float, 4>>(scene, geometry.positions)) {
                const double distance =
                    std::hypot(s[0] - camera.eye[0], s[1] - camera.eye[1], s[2] - camera.eye[2]) - double{s[3]};
                if (distance > 0 && distance < 1)
                    return true;
            }
    return false;
}

template <class T> std::span<T> view(arhost_scene &scene, const arhost_buffer &buffer) {
    const auto seen = view<T>(std::as_const(scene), buffer);
    return {const_cast<T *>(seen.data()), seen.size()};
}

void modify(arhost_scene &scene) {
    const auto geometries = view<arhost_geometry>(scene, scene.geometries);
    const auto objects = view<arhost_object>(scene, scene.objects);
    if (has("lambert_only"))
        for (arhost_material &material : view<arhost_material>(scene, scene.materials))
            material.model = ARHOST_MATERIAL_DIFFUSE;
    if (has("ignores_follows_video"))
        scene.environment.follows_video = 0;
    if (has("untinted_shadows"))
        for (arhost_material &material : view<arhost_material>(scene, scene.materials))
            std::fill_n(material.shadow_attenuation, 3, 1.0f);
    if (has("invisible_lamps"))
        for (arhost_light &light : view<arhost_light>(scene, scene.lights))
            if (light.type == ARHOST_LIGHT_RECTANGLE || light.type == ARHOST_LIGHT_SPHERE)
                light.type = ARHOST_LIGHT_POINT;
    if (has("max_8_objects"))
        scene.objects.count = std::min(scene.objects.count, 8u);
    if (has("max_256_objects"))
        scene.objects.count = std::min(scene.objects.count, 256u);
    if (has("materials_by_object"))
        for (std::uint32_t i = 0; i < objects.size(); ++i)
            objects[i].material = std::min(i, scene.materials.count - 1);
    if (has("indices_of_16_bits"))
        for (const arhost_geometry &geometry : geometries)
            for (auto &triangle : view<std::array<std::uint32_t, 3>>(scene, geometry.indices))
                for (std::uint32_t &index : triangle)
                    index &= 0xffff;
    if (has("transforms_normals_as_points")) // chosen so that the inverse transpose transforms them like points
        for (const arhost_object &object : objects) {
            const float *m = object.world_from_object;
            for (auto &normal : view<std::array<float, 3>>(scene, geometries[object.geometry].normals)) {
                std::array<float, 3> turned{}, back{};
                for (std::size_t i = 0; i < 9; ++i)
                    turned[i % 3] += m[i] * normal[i / 3];
                for (std::size_t i = 0; i < 9; ++i)
                    back[i / 3] += m[i] * turned[i % 3];
                normal = back;
            }
        }
}

arhost_intrinsics finer(arhost_intrinsics in, std::uint32_t times) {
    in.width *= times;
    in.height *= times;
    for (double *focal : {&in.fx, &in.fy})
        *focal *= times;
    for (double *centre : {&in.cx, &in.cy})
        *centre = (*centre + 0.5) * times - 0.5;
    return in;
}

void start_other(Wrong &self, arhost_raytracer_setup setup) {
    self.other_scene = make_copy(*setup.scene);
    arhost_scene &scene = scene_in(self.other_scene);
    const auto materials = view<arhost_material>(scene, scene.materials);
    for (arhost_object &object : view<arhost_object>(scene, scene.objects))
        if (has("blends_linearly") ? object.role == ARHOST_ROLE_CATCHER
                                   : has("adds_shadows") && object.role == ARHOST_ROLE_VIRTUAL &&
                                         materials[object.material].model != ARHOST_MATERIAL_GLASS)
            object.world_from_object[11] -= 1e6f; // invisible
    if (has("facets_in_shadow"))
        for (arhost_geometry &geometry : view<arhost_geometry>(scene, scene.geometries))
            geometry.normals.count = 0;
    const arhost_intrinsics intrinsics = finer(*setup.intrinsics, self.fineness);
    setup.scene = &scene;
    setup.intrinsics = &intrinsics;
    setup.width = intrinsics.width;
    setup.height = intrinsics.height;
    setup.form = ARHOST_IMAGE_FORM_STRAIGHT;
    embree_functions().start(self.other, &setup);
}

double decoded(std::uint8_t code) {
    return shading::srgb_decode(code / 255.0);
}

// Combines a pixel with the pixels of the other image, from column `x` and row `y` on.
void combine(std::uint8_t *pixel, const Pixels &other, std::uint32_t x, std::uint32_t y, std::uint32_t fineness) {
    const std::uint8_t *same = other.at(x, y);
    if (has("adds_shadows") && pixel[3] == 153 && same[3] == 77)
        pixel[3] = 153 + 77;
    if (has("facets_in_shadow") && same[0] + same[1] + same[2] == 0)
        std::fill_n(pixel, 3, std::uint8_t{0});
    for (int channel = 0; channel < 3; ++channel) {
        if (has("blends_linearly") && pixel[3] > same[3] && same[3] > 0)
            pixel[channel] = shading::srgb8_exact(decoded(same[channel]) * same[3] / pixel[3]);
        if (fineness == 1 || pixel[3] < 255)
            continue;
        double codes = 0, light = 0;
        for (std::uint32_t i = 0; i < fineness * fineness; ++i) {
            const std::uint8_t code = other.at(x + i % fineness, y + i / fineness)[channel];
            codes += code;
            light += decoded(code);
        }
        const double count = fineness * fineness;
        pixel[channel] = static_cast<std::uint8_t>(has("averages_codes") ? std::lround(codes / count)
                                                                         : shading::srgb8_exact(light / count));
    }
}

arhost_status start(arhost_instance *instance, const arhost_raytracer_setup *setup) {
    misbehave_in("start");
    if (has("writes_into_scene"))
        const_cast<arhost_scene *>(setup->scene)->max_depth = 1;
    if (has("crash_on_degenerate") && has_degenerate_triangle(*setup->scene))
        crash();
    if (has("cannot_restart") && std::exchange(wrong(instance).was_started, true))
        return ARHOST_STATUS_ERROR_INTERNAL;
    const arhost_intrinsics intrinsics = modify(*setup->intrinsics);
    arhost_raytracer_setup modified = *setup;
    modified.intrinsics = &intrinsics;
    Wrong &self = wrong(instance);
    self.width = setup->width;
    SceneCopy copy = make_copy(*setup->scene);
    modify(scene_in(copy));
    modified.scene = &scene_in(copy);
    if (has("ignores_form"))
        modified.form = ARHOST_IMAGE_FORM_STRAIGHT;
    self.is_tiny = modified.scene->bounds_max[0] - modified.scene->bounds_min[0] < 1;
    if (self.other)
        start_other(self, modified);
    const arhost_status status = embree_functions().start(self.real, &modified);
    self.scene = std::move(copy); // frees the previous one
    return status;
}

// The video that the ray tracer reads instead of that of the request.
class OtherVideo {
public:
    OtherVideo(Wrong &self, const arhost_frame *video) : frame_(video) {
        std::vector<std::uint8_t> now;
        if (video)
            now.assign(video->plane[0],
                       video->plane[0] + std::size_t{video->format->stride[0]} * video->format->height);
        if ((has("shows_previous_video") || (has("keeps_last_video") && !video)) && !self.last_video.empty()) {
            bytes_ = self.last_video;
            replace(self.last_format);
            copy_.plane[0] = bytes_.data();
        }
        if (has("ignores_video"))
            frame_ = nullptr;
        if (video && has("rgb_video_as_bgr") && video->format->pixel_format == ARHOST_PIXEL_FORMAT_RGB8) {
            replace(*video->format);
            format_.pixel_format = ARHOST_PIXEL_FORMAT_BGR8;
        }
        if (video && has("all_video_has_full_range")) {
            replace(*video->format);
            format_.yuv_range = ARHOST_YUV_RANGE_FULL;
        }
        if (video) {
            self.last_video = std::move(now);
            self.last_format = *video->format;
        }
    }
    const arhost_frame *frame() const { return frame_; }

private:
    void replace(const arhost_frame_format &format) {
        copy_ = frame_ ? *frame_ : arhost_frame{};
        format_ = format;
        copy_.format = &format_;
        frame_ = &copy_;
    }

    const arhost_frame *frame_;
    arhost_frame_format format_{};
    arhost_frame copy_{};
    std::vector<std::uint8_t> bytes_;
};

arhost_status render_linear(const Wrong &self, const arhost_render_request &request, const arhost_image &image,
                            arhost_render_info &info) {
    const LinearPixels pixels{image};
    const std::uint16_t last_number = pixels.at(image.width - 1, image.height - 1).reserved_1;
    arhost_image target = image;
    if (has("ignores_form")) {
        target.rgba = reinterpret_cast<std::uint8_t *>(image.linear);
        target.linear = nullptr;
    }
    const arhost_status status = embree_functions().render(self.real, &request, &target, &info);
    if (status != ARHOST_STATUS_OK)
        return status;
    modify(pixels);
    modify(info, image);
    if (has("unwritten_reserved_number"))
        pixels.at(image.width - 1, image.height - 1).reserved_1 = last_number;
    return status;
}

// The state of the ray tracers that have one counts the images. Later images are brighter.
constexpr std::size_t state_bytes = 5000;
std::uint64_t state_size(arhost_instance *) {
    constexpr const char *defects[] = {
        "counts_in_its_state",       "counts_in_its_heap",        "reads_state_after",       "writes_half_its_state",
        "counts_linear_in_its_heap", "counts_scaled_in_its_heap", "counts_video_in_its_heap"};
    return std::ranges::any_of(defects, [](const char *defect) { return has(defect); }) ? state_bytes : 0;
}

// Returns the number of images before this one.
unsigned count(Wrong &self, const arhost_render_request &request, const arhost_image &image) {
    const auto *before = static_cast<const std::uint8_t *>(request.state_before);
    auto *after = static_cast<std::uint8_t *>(request.state_after);
    unsigned images = before ? before[0] : 0;
    const bool in_heap = has("counts_in_its_heap") || (has("counts_linear_in_its_heap") && image.linear) ||
                         (has("counts_scaled_in_its_heap") && image.width < self.width) ||
                         (has("counts_video_in_its_heap") && request.video);
    if (in_heap && before)
        images = self.images;
    if (has("reads_state_after") && before)
        images += after[0] & 3u;
    std::memset(after, 0, has("writes_half_its_state") ? state_bytes / 2 : state_bytes);
    after[0] = static_cast<std::uint8_t>(images + 1);
    ++self.images;
    return images;
}

arhost_status render(arhost_instance *instance, const arhost_render_request *request, const arhost_image *image,
                     arhost_render_info *info) {
    Wrong &self = wrong(instance);
    misbehave_in("render");
    if (has("exits_in_render"))
        std::exit(0);
    if (has("crash_on_nan") && std::isnan(request->camera.eye[0]))
        crash();
    if (has("slow") && image->width >= 640)
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
    if (has("ignores_cancel_while_rendering") && image->width > 1000)
        std::this_thread::sleep_for(std::chrono::seconds(8)); // the limit is 2 s times the timeout factor
    if (has("leaks_descriptors_in_render"))
        (void)::dup(0);
    if (has("leaks_memory_in_render"))
        leak_memory(4096);
    if (has("cancelled_is_internal") && self.host->cancelled(self.host))
        return ARHOST_STATUS_ERROR_INTERNAL;

    arhost_render_request modified = *request;
    modified.state_before = modified.state_after = nullptr; // `count` has the state
    modified.state_size = 0;
    modified.camera = modify(request->camera);
    if (has("ignores_max_samples"))
        modified.max_samples = 0;
    if (has("keeps_max_samples"))
        modified.max_samples = self.max_samples = request->max_samples ? request->max_samples : self.max_samples;
    if (has("near_clip_at_1_mm") && is_near(self, modified.camera))
        modified.camera.eye[2] -= 1; // the camera looks along −z
    if (has("ignores_sequence"))
        modified.sequence = 0;
    const OtherVideo video(self, request->video);
    modified.video = video.frame();
    if (image->linear) {
        if (request->state_size > 0)
            count(self, *request, *image);
        return render_linear(self, modified, *image, *info);
    }
    const arhost_moved_object nowhere{0, 1, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}};
    const arhost_motion still{sizeof still, 1, &nowhere, nullptr, 0, 0};
    if ((has("no_motion") || has("lambert_only")) && request->motion)
        modified.motion = &still;
    std::vector<arhost_moved_object> moved;
    arhost_motion shown{};
    if (has("draws_hidden_objects") && request->motion) {
        shown = *request->motion;
        moved.assign(shown.moved, shown.moved + shown.moved_count);
        for (arhost_moved_object &object : moved)
            object.is_visible = 1;
        shown.moved = moved.data();
        modified.motion = &shown;
    }
    const Pixels pixels{*image};
    std::vector<std::array<std::uint8_t, 4>> before;
    pixels.each([&](const std::uint8_t *p) { before.push_back({p[0], p[1], p[2], p[3]}); });
    arhost_status status = embree_functions().render(self.real, &modified, image, info);
    if (has("accepts_parallel_up") && status == ARHOST_STATUS_ERROR_INVALID_ARGUMENT) {
        modified.camera.up[0] += 1;
        status = embree_functions().render(self.real, &modified, image, info);
    }
    if (status != ARHOST_STATUS_OK)
        return status;

    modify(pixels);
    if (has("coarse_edges") && request->shading_px > 1)
        for (std::uint32_t y = 0; y < image->height; ++y)
            for (std::uint32_t x = 0; x < image->width; ++x)
                std::copy_n(pixels.at(x & ~1u, y & ~1u), 4, pixels.at(x, y));
    self.shading_px = std::max(self.shading_px, request->shading_px);
    if (has("keeps_shading_px") && self.shading_px > 1)
        pixels.each_colour([](double colour, double) { return std::min(1.0, colour + 0.02); });
    if (request->state_size > 0) {
        const unsigned images = count(self, *request, *image);
        pixels.each_colour([&](double colour, double) { return std::min(1.0, colour + 0.02 * images); });
    }
    if (has("drops_small_objects") && self.is_tiny)
        pixels.each([](std::uint8_t *p) { p[3] = 0; });
    if (has("unwritten_pixel"))
        std::copy(before.back().begin(), before.back().end(), pixels.at(image->width - 1, image->height - 1));
    if (has("unwritten_misses")) {
        auto old = before.begin();
        pixels.each([&](std::uint8_t *p) {
            if (p[3] == 0)
                std::copy(old->begin(), old->end(), p);
            ++old;
        });
    }
    if (has("nondeterministic")) {
        static std::atomic<unsigned> images{0};
        const unsigned noise = images++ & 1;
        pixels.each([&](std::uint8_t *p) { p[1] = static_cast<std::uint8_t>(p[3] == 255 ? p[1] ^ noise : p[1]); });
    }
    if (has("depends_on_threads") && self.threads == 2)
        pixels.each_colour([](double colour, double) { return std::min(1.0, colour + 0.02); });
    if (has("stale_image")) {
        const std::size_t size = std::size_t{image->stride} * (image->height - 1) + std::size_t{4} * image->width;
        std::vector<std::uint8_t> now(image->rgba, image->rgba + size);
        if (self.last.size() == size)
            for (std::uint32_t y = 0; y < image->height; ++y)
                std::copy_n(self.last.begin() + static_cast<std::ptrdiff_t>(image->stride) * y, 4 * image->width,
                            pixels.at(0, y));
        self.last = std::move(now);
    }
    if (self.other) {
        modified.camera.intrinsics = finer(modified.camera.intrinsics, self.fineness);
        const std::uint32_t width = image->width * self.fineness, height = image->height * self.fineness;
        const std::uint32_t stride = (4 * width + 63) / 64 * 64;
        std::vector<std::uint8_t> bytes(std::size_t{stride} * height);
        const arhost_image other{sizeof other, stride, width, height, bytes.data(), nullptr, nullptr};
        embree_functions().render(self.other, &modified, &other, info);
        for (std::uint32_t y = 0; y < image->height; ++y)
            for (std::uint32_t x = 0; x < image->width; ++x)
                combine(pixels.at(x, y), {other}, x * self.fineness, y * self.fineness, self.fineness);
        info->has_region = 0;
    }
    if (has("linear_shadow_alpha")) { // partial shadows only
        const arhost_scene &scene = scene_in(self.scene);
        const double opaque = double{scene.shadow_alpha_opaque}, translucent = double{scene.shadow_alpha_translucent};
        pixels.each([&](std::uint8_t *p) {
            const double alpha = p[3] / 255.0;
            const auto is = [&](double other) { return std::abs(alpha - other) < 0.5 / 255; };
            if (alpha < opaque && !is(translucent))
                p[3] = static_cast<std::uint8_t>(std::lround(255 * opaque * (1 - shading::light_under_alpha(alpha)) /
                                                             (1 - shading::light_under_alpha(opaque))));
        });
    }
    modify(*info, *image);
    if (has("device_time_since_boot"))
        info->device_time_ns =
            static_cast<std::uint64_t>(std::chrono::steady_clock::now().time_since_epoch().count());
    return has("status_0") ? 0 : status;
}

void stop(arhost_instance *instance) {
    misbehave_in("stop");
    embree_functions().stop(wrong(instance).real);
    if (wrong(instance).other)
        embree_functions().stop(wrong(instance).other);
}

arhost_status list_devices(const arhost_host *, arhost_take_device take, void *context) {
    static std::uint32_t lists = 0;
    const std::uint32_t list = lists++;
    if (has("devices_fail"))
        return ARHOST_STATUS_ERROR_INTERNAL;
    if (has("devices_leak"))
        (void)::dup(0);
    double rates[] = {30, 15};
    arhost_device_size size{sizeof size, 640, 480, 2, 0, 0, rates};
    const arhost_device_format format{sizeof format, 1, 0, 0, "yuyv", &size};
    arhost_device_control control{sizeof control, ARHOST_DEVICE_CONTROL_INTEGER, 1, 0, "gain", 0, 9, 1, 5, list};
    if (has("device_infinite_rate"))
        rates[0] = std::numeric_limits<double>::infinity();
    if (has("device_slowest_rate_first"))
        rates[0] = 1;
    if (has("device_empty_size"))
        size.height = 0;
    if (has("device_reversed_range"))
        control.minimum = 10;
    for (std::uint32_t i = 0; i < 2; ++i) {
        arhost_device device{};
        device.struct_size = sizeof device;
        device.index = i;
        device.kind = ARHOST_DEVICE_CAMERA;
        device.state = has("device_without_state") ? 0 : ARHOST_DEVICE_STATE_USABLE;
        device.is_default = i == 0;
        device.name = i == 0 ? "first" : "second";
        device.formats = has("device_formats_null") ? nullptr : &format;
        device.controls = &control;
        device.format_count = device.control_count = 1;
        if (has("busy_device_without_path"))
            device.state = ARHOST_DEVICE_STATE_BUSY;
        if (has("devices_without_index"))
            device.index = 0;
        if (has("two_default_devices"))
            device.is_default = 1;
        if (has("unnamed_device"))
            device.name = nullptr;
        if (has("devices_differ") && list % 2 == 1 && i == 1)
            device.name = "another";
        take(context, &device);
    }
    return ARHOST_STATUS_OK;
}

arhost_status set_option(arhost_instance *, const arhost_option *) {
    return ARHOST_STATUS_OK;
}

const void *get_extension(const char *id) {
    static const char *const keys[] = {"samples", "no_such_option", nullptr};
    static const arhost_set_option changes = {sizeof changes, 0, keys,
                                              has("set_option_without_function") ? nullptr : set_option};
    if (!std::strcmp(id, ARHOST_SET_OPTION_EXTENSION))
        return library_name().find("set_option") != std::string::npos ? &changes : nullptr;
    static const arhost_devices devices = {sizeof devices, 0, list_devices};
    if (!std::strcmp(id, ARHOST_DEVICES_EXTENSION))
        return library_name().find("device") != std::string::npos ? &devices : nullptr;
    return has("returns_any_extension") ? &library_name() : nullptr;
}

std::uint64_t capabilities(arhost_instance *) {
    return ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION;
}

const arhost_plugin &wrong_plugin() {
    static const arhost_raytracer functions = {sizeof functions,
                                               0,
                                               start,
                                               has("no_render") ? nullptr : render,
                                               stop,
                                               has("lambert_only") ? capabilities : nullptr,
                                               state_size};
    static std::vector<arhost_option_descriptor> options(
        embree().descriptor->options, embree().descriptor->options + embree().descriptor->option_count);
    static arhost_descriptor descriptor = *embree().descriptor;
    descriptor.id = has("id_differs_from_file") ? "org.arhost.test.rt_other"
                    : has("id_without_domain")  ? library_name().c_str()
                                                : library_id();
    if (has("default_out_of_range"))
        options[0].default_value = "257";
    if (has("no_licence"))
        descriptor.licence = "";
    if (has("description_not_utf8"))
        descriptor.description = "Bas\xe9";
    static const std::string long_name(5'000'000, 'x');
    if (has("long_name"))
        descriptor.name = long_name.c_str();
    if (has("option_without_key"))
        options[1].key = nullptr;
    if (has("many_options"))
        options.resize(5000, options[0]); // with equal keys: only the number matters
    descriptor.options = options.data();
    descriptor.option_count = static_cast<std::uint32_t>(options.size());
    static constexpr const char *unknown[] = {"bluetooth", nullptr};
    if (has("unknown_need"))
        descriptor.needs = unknown;
    if (has("unknown_capability"))
        descriptor.capabilities |= std::uint64_t{1} << 63;
    static bool was_called = false;
    if (has("withdraws_a_capability") && std::exchange(was_called, true))
        descriptor.capabilities &= ~ARHOST_RAYTRACER_CAPABILITY_LENS_DISTORTION;
    static const arhost_plugin plugin = {sizeof plugin,
                                         0,
                                         &descriptor,
                                         &functions,
                                         create,
                                         destroy,
                                         has("no_get_extension") ? nullptr : get_extension};
    return plugin;
}

arhost_status negotiate(const arhost_offer *offer, arhost_answer *answer) {
    misbehave_in("negotiate");
    if ((offer->struct_size < sizeof *offer && !has("reads_past_short_offer")) ||
        (answer->struct_size < sizeof *answer && !has("writes_past_short_answer")))
        return ARHOST_STATUS_ERROR_INVALID_ARGUMENT;
    if (offer->oldest_abi_version > ARHOST_ABI_VERSION && !has("accepts_any_version"))
        return ARHOST_STATUS_ERROR_UNSUPPORTED;
    answer->abi_version = offer->oldest_abi_version;
    answer->plugin = &wrong_plugin();
    return ARHOST_STATUS_OK;
}

} // namespace

extern "C" {
#ifdef EXPORTS_MORE
ARHOST_EXPORT int leaked_symbol = 1;
#endif
extern ARHOST_EXPORT const arhost_entry_point arhost_entry = {sizeof arhost_entry, 0, negotiate};
}
