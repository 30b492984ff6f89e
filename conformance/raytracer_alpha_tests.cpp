// SPDX-License-Identifier: Apache-2.0
// Alpha: transparency, coverage and shadows.
#include "conformance/expect.hpp"
#include "conformance/tracer.hpp"

#include <arhost/shading/scalar.hpp>

namespace arhost::conformance {
namespace {

constexpr double rim = 1.5; // px on each side of a silhouette that are not checked
constexpr int opaque = 153, translucent = 77;

// A sphere of radius 30 at the origin, seen from (0, 0, 200): its silhouette has this radius.
const double silhouette = 200 * 30 / std::sqrt(200.0 * 200 - 30 * 30);

void empty_scene(Context &context) {
    const Picture picture = Tracer(context, scene::ArenaBuilder()).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const int alpha = picture.alpha(x, y);
        return alpha == 0 ? "" : fmt::format("the scene is empty, alpha is {}; expected 0", alpha);
    });
}

void miss_alpha(Context &context) {
    const Picture picture = Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const int alpha = picture.alpha(x, y);
        const bool miss = distance_from_centre(picture, x, y) > silhouette + rim;
        return !miss || alpha == 0 ? "" : fmt::format("no ray hit, alpha is {}; expected 0", alpha);
    });
}

void hit_alpha(Context &context) {
    const Picture picture = Tracer(context, one_sphere({0, 0, 0, 30})).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const int alpha = picture.alpha(x, y);
        const bool hit = distance_from_centre(picture, x, y) < silhouette - rim;
        return !hit || alpha == 255 ? "" : fmt::format("every ray hit the sphere, alpha is {}; expected 255", alpha);
    });
}

void inside_sphere(Context &context) {
    const Picture picture = Tracer(context, one_sphere({0, 0, 200, 50})).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const int alpha = picture.alpha(x, y);
        return alpha == 255 ? "" : fmt::format("the eye is inside a sphere, alpha is {}; expected 255", alpha);
    });
}

void near_the_eye(Context &context) {
    // `mm`: distance from the eye to the centre of the near sphere. Its surface is 0.75 × mm away, which is at least
    // 1.6e-4 × scene extent, so the near clip must not remove it.
    for (const double mm : {1.0, 0.05}) {
        scene::ArenaBuilder builder = one_sphere({0, 0, 0, 30}, glowing(glm::vec3(0.1f)));
        builder.add_object("near", builder.add_spheres({{0, 0, 200 - mm, mm / 4}}),
                           builder.add_material(glowing(glm::vec3(0.8f))));
        const Picture picture = Tracer(context, std::move(builder)).render(from_front());
        expect_pixels(picture, [&](auto x, auto y) {
            constexpr double radius = 48; // px; the silhouette's radius is 51.6 px
            const Pixel p = picture.at(x, y);
            if (distance_from_centre(picture, x, y) < radius && (p[0] < 150 || p[3] < 250)) // correct: 231 and 255
                return fmt::format("a bright sphere {} mm in front of the eye is not visible; the pixel is {}", mm,
                                   text_of(p));
            return std::string();
        });
    }
}

void depth_order(Context &context) {
    scene::ArenaBuilder builder = one_sphere({0, 0, 0, 30}, glowing(glm::vec3(0.1f)));
    const std::uint32_t bright = builder.add_material(glowing(glm::vec3(0.8f)));
    for (const float z : {-60.0f, 60.0f}) // the farther one is hidden
        builder.add_object("small", builder.add_spheres({{0, 0, z, 8}}), bright);
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const double r = distance_from_centre(picture, x, y);
        const int code = picture.at(x, y)[0];
        if (r < 8 && code < 150) // correct: 231; accepts a fifth too dark
            return fmt::format("the near sphere is bright, but the code is {}: a farther object is visible", code);
        if (r > 20 && r < 25 && code > 120) // correct: 89
            return fmt::format("only the large, dark sphere is visible here, but the code is {}", code);
        return std::string();
    });
}

void occluder(Context &context) {
    scene::ArenaBuilder builder = one_sphere({0, 0, 0, 30});
    const std::uint32_t material = builder.add_material(diffuse(glm::vec3(1)));
    const std::uint32_t screen = builder.add_triangles(box({10, 10, 1}));
    for (const float z : {-60.0f, 60.0f})
        builder.add_object(
            "screen", screen, material, ARHOST_ROLE_OCCLUDER,
            glm::mat4x3(glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1), glm::vec3(0, 0, z)));
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    expect_pixels(picture, [&](auto x, auto y) {
        const double r = distance_from_centre(picture, x, y);
        const int alpha = picture.alpha(x, y);
        if (r < 12 && alpha > 2) // the screen covers ±14 px; miss-alpha checks for exactly 0
            return fmt::format("an occluder hides the sphere, alpha is {}; expected 0", alpha);
        if (r > 22 && r < silhouette - rim && alpha < 250)
            return fmt::format("the occluder does not hide the sphere here, alpha is {}; expected 255", alpha);
        return std::string();
    });
}

// ---- Shadows ---------------------------------------------------------------------------------------

// Checks the shadow of ball_over_catcher around the image's centre.
void expect_shadow(const Picture &picture, int alpha, const char *caster) {
    constexpr int radius = 10; // px; the shadow's radius is at least 15 px
    expect_pixels(picture, [&](auto x, auto y) {
        if (distance_from_centre(picture, x, y) > radius)
            return std::string();
        const Pixel p = picture.at(x, y);
        if (p[3] != alpha)
            return fmt::format("in the shadow of {}, alpha is {}; expected {}", caster, p[3], alpha);
        if (p[0] + p[1] + p[2] != 0)
            return fmt::format("in the shadow of {}, the colour is {}; expected black", caster, text_of(p));
        return std::string();
    });
}

void opaque_shadow(Context &context) {
    const Picture picture = Tracer(context, ball_over_catcher(diffuse(glm::vec3(0.5f)))).render(from_front());
    expect_shadow(picture, opaque, "an opaque ball");
}

void translucent_shadow(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_GLASS, "GLASS");
    const Picture picture = Tracer(context, ball_over_catcher(glass())).render(from_front());
    expect_shadow(picture, translucent, "a glass ball");
}

void catcher_in_light(Context &context) {
    const Picture picture = Tracer(context, ball_over_catcher(diffuse(glm::vec3(0.5f)))).render(from_front());
    // Checks pixels left of, above and below the shadow; also valid for a mirrored image.
    expect_pixels(picture, [&](auto x, auto y) {
        const bool far = distance_from_centre(picture, x, y) > 24;
        const bool ball = std::abs(y - (picture.height() - 1) / 2.0) < 22;
        const int alpha = picture.alpha(x, y);
        return !far || ball || alpha <= 2 ? "" : fmt::format("the catcher is lit, alpha is {}; expected 0", alpha);
    });
}

void stronger_shadow_wins(Context &context) {
    need_capability(context, ARHOST_RAYTRACER_CAPABILITY_GLASS, "GLASS");
    scene::ArenaBuilder builder = ball_over_catcher(diffuse(glm::vec3(0.5f)));
    // A glass sphere between lamp and ball. Its shadow covers half of the ball's shadow and extends beyond it.
    builder.add_object("glass", builder.add_spheres({{90, 7, 120, 8}}), builder.add_material(glass()));
    const Picture picture = Tracer(context, std::move(builder)).render(from_front());
    // The glass ball's shadow (20 mm about y = 17.5) covers the upper half of the other (15 mm about y = 0).
    const int overlap = picture.alpha(79, 59 - 6), opaque_only = picture.alpha(79, 59 + 8);
    if (std::abs(overlap - opaque_only) > 2)
        throw Failure(fmt::format("where an opaque and a translucent shadow overlap, alpha is {}; expected {} as in "
                                  "the opaque shadow alone",
                                  overlap, opaque_only))
            .with("rendered", picture);
}

void shadow_alpha_of_the_scene(Context &context) {
    for (const bool is_glass : {false, true}) {
        if (is_glass && !has_capability(context, ARHOST_RAYTRACER_CAPABILITY_GLASS))
            break;
        scene::ArenaBuilder builder = ball_over_catcher(is_glass ? glass() : diffuse(glm::vec3(0.5f)));
        builder.settings.shadow_alpha_opaque = 0.8f;
        builder.settings.shadow_alpha_translucent = 0.2f;
        const Picture picture = Tracer(context, std::move(builder)).render(from_front());
        const int expected = is_glass ? 51 : 204;
        const int alpha = picture.alpha(79, 59);
        if (alpha != expected)
            throw Failure(fmt::format("pixel (79, 59): the scene sets {} shadows to alpha {}, but it is {}",
                                      is_glass ? "translucent" : "opaque", expected, alpha))
                .with("rendered", picture)
                .at(79, 59);
    }
}

// One of two lamps is hidden. Its light is two thirds of the light of both.
void partial_shadow(Context &context) {
    for (const bool is_glass : {false, true}) {
        if (is_glass && !has_capability(context, ARHOST_RAYTRACER_CAPABILITY_GLASS))
            break;
        scene::ArenaBuilder builder = ball_over_catcher(is_glass ? glass() : diffuse(glm::vec3(0.5f)));
        const double alpha_opaque = double{builder.settings.shadow_alpha_opaque},
                     alpha_translucent = double{builder.settings.shadow_alpha_translucent};
        builder.add_light(lamp({-150, 0, 200}, 0.5f));
        const Picture picture = Tracer(context, std::move(builder)).render(from_front());
        const double hidden = 2.0 / 3;
        const double alpha =
            shading::shadow_alpha(is_glass ? 0 : hidden, is_glass ? hidden : 0, alpha_opaque, alpha_translucent);
        const int expected = static_cast<int>(shading::code_8bit(alpha)), actual = picture.alpha(79, 59);
        if (std::abs(actual - expected) > 1)
            throw Failure(
                fmt::format("pixel (79, 59): {} hides two thirds of the light, alpha is {}; expected {}, so "
                            "that the linear light over mid-grey video is right",
                            is_glass ? "a glass ball" : "an opaque ball", actual, expected))
                .with("rendered", picture)
                .at(79, 59);
    }
}

// ---- Edges -----------------------------------------------------------------------------------------

void straight_alpha(Context &context) {
    const Picture picture =
        Tracer(context, one_sphere({0, 0, 0, 30}, glowing({0.8f, 0.8f, 0.8f})), many_samples(context))
            .render(from_front());
    const int inside = picture.at(79, 59)[1];
    int edges = 0;
    expect_pixels(picture, [&](auto x, auto y) {
        const Pixel p = picture.at(x, y);
        const bool edge = p[3] > 40 && p[3] < 250 && std::abs(distance_from_centre(picture, x, y) - silhouette) < rim;
        edges += edge ? 1 : 0;
        return !edge || std::abs(p[1] - inside) <= 4
                   ? ""
                   : fmt::format("alpha is {}, green is {}; expected {} as in fully covered pixels (straight alpha)",
                                 p[3], p[1], inside);
    });
    if (edges == 0)
        throw Skip("no pixel is partially covered");
}

void edge_over_shadow(Context &context) {
    scene::ArenaBuilder builder = one_sphere({0, 0, 0, 30}, glowing({0.8f, 0.8f, 0.8f}));
    const std::uint32_t material = builder.add_material(diffuse(glm::vec3(0.8f)));
    builder.add_object("floor", builder.add_triangles(square(400, -50)), material, ARHOST_ROLE_CATCHER);
    builder.add_object("roof", builder.add_triangles(square(400, 300)), material); // above the camera
    builder.add_light(lamp({0, 0, 1000}, 1));
    const Picture picture = Tracer(context, std::move(builder), many_samples(context)).render(from_front());
    const int inside = picture.at(79, 59)[1];
    int edges = 0;
    expect_pixels(picture, [&](auto x, auto y) {
        const Pixel p = picture.at(x, y);
        if (p[3] <= opaque || p[3] == 255)
            return std::string();
        ++edges;
        const double coverage = (p[3] - opaque) / (255.0 - opaque);
        const int expected = static_cast<int>(std::lround(inside * coverage * 255 / p[3]));
        return std::abs(p[1] - expected) <= 4
                   ? ""
                   : fmt::format("the sphere covers {:.0f} % of a pixel in shadow, green is {}; expected {}: the "
                                 "sphere's code {} and black, blended by their shares of the alpha",
                                 100 * coverage, p[1], expected, inside);
    });
    if (edges == 0)
        throw Skip("no pixel is partially covered");
}

constexpr const char *gate = "raytracer.render";
constexpr Test tests[] = {
    {"raytracer.empty-scene", "A scene without objects has alpha 0 everywhere.", gate, 20s, empty_scene},
    {"raytracer.miss-alpha", "Where no ray hits, alpha is exactly 0.", gate, 20s, miss_alpha},
    {"raytracer.hit-alpha", "Where every ray hits a virtual object, alpha is exactly 255.", gate, 20s, hit_alpha},
    {"raytracer.straight-alpha", "The colour of a partially covered pixel is not premultiplied by alpha.", gate, 20s,
     straight_alpha},
    {"raytracer.edge-over-shadow",
     "Where an edge is in front of a shadow, object and shadow are blended in sRGB by their shares of the alpha.",
     gate, 20s, edge_over_shadow},
    {"raytracer.inside-sphere", "A camera inside an object sees the object in every pixel.", gate, 20s,
     inside_sphere},
    {"raytracer.near-the-eye", "Objects 0.05 mm in front of the eye are visible.", gate, 20s, near_the_eye},
    {"raytracer.depth-order", "The nearer object hides the farther one.", gate, 20s, depth_order},
    {"raytracer.occluder", "An occluder hides only what is behind it.", gate, 20s, occluder},
    {"raytracer.catcher-in-light", "A lit shadow catcher is invisible.", gate, 20s, catcher_in_light},
    {"raytracer.opaque-shadow", "The shadow of an opaque object on a catcher is black with alpha 153.", gate, 20s,
     opaque_shadow},
    {"raytracer.translucent-shadow", "The shadow of a glass object on a catcher is black with alpha 77.", gate, 20s,
     translucent_shadow},
    {"raytracer.stronger-shadow-wins",
     "Where opaque and translucent shadows overlap, alpha is that of the opaque one.", gate, 20s,
     stronger_shadow_wins},
    {"raytracer.shadow-alpha-of-scene", "Shadow alphas are those of the scene's settings.", gate, 20s,
     shadow_alpha_of_the_scene},
    {"raytracer.partial-shadow",
     "Where light is partly hidden, alpha gives the right linear light over mid-grey video (sRGB 0.5).", gate, 20s,
     partial_shadow},
};

} // namespace

std::span<const Test> raytracer_alpha_tests() {
    return tests;
}

} // namespace arhost::conformance
