// SPDX-License-Identifier: Apache-2.0
//
// The input of the denoiser (raytracer_common/denoiser/layers.hpp): planes of one word per pixel, which take the place of the
// pixels in the buffer Image.

// Planes of the surface that the ray through a pixel's centre meets, as GuideRow.
const uint POSITION_PLANE = 0u, // three planes: mm, in world axes
    NORMAL_PLANE = 3u,          // three planes: unit vector
    ALBEDO_PLANE = 6u,          // three planes: the factor of the denoised light
    SURFACE_PLANE = 9u,         // number of the surface; 0: none
    // Three planes: the radiance of a virtual surface, divided by its albedo, or the change of a catcher.
    LIGHT_PLANE = 10u,
    TAPS_PLANE = 13u,  // of pixels at edges (taps.glsl)
    GLOSS_PLANE = 14u; // three planes, if has_gloss: the light that glossy catchers mirror, minus what virtual objects hide

bool is_denoised() {
    return may_denoise && frame.denoises != 0u;
}

uint layer_word(uint plane, uint pixel) {
    return plane * frame.width * frame.height + pixel;
}
void write_layer(uint plane, uint pixel, vec3 rows) {
    for (uint i = 0u; i < 3u; ++i)
        image_pixels[layer_word(plane + i, pixel)] = floatBitsToUint(rows[i]);
}
vec3 read_layer(uint plane, uint pixel) {
    return uintBitsToFloat(uvec3(image_pixels[layer_word(plane, pixel)], image_pixels[layer_word(plane + 1u, pixel)],
                                 image_pixels[layer_word(plane + 2u, pixel)]));
}

// Kinds of surfaces, as SurfaceKind.
const uint SCATTERING_SURFACE = 0u, SPECULAR_SURFACE = 1u, REAL_SURFACE = 2u, GLOSSY_SURFACE = 3u;
// Where a specular surface shows another one, follow_specular() adds MIRRORED_UNIT · (index of the latter + 1).
const uint MIRRORED_UNIT = 1u << 20;

uint kind_of(uint surface) {
    return surface & 3u;
}

// Returns whether the eye sees through a surface, clearly.
bool is_seen_through(Hit hit) {
    uint material = objects[hit.object].material, number = materials[material].transmission_texture;
    if (has_holes && (objects[hit.object].flags & BLENDS) != 0u &&
        opacity_at(hit.object, primitives[hit.primitive].number, hit.uv) < 1.0)
        return true;
    const float clear = 0.05; // roughness
    float transmission = materials[material].transmission;
    if (!has_glass || !(transmission > 0.0) || materials[material].roughness > clear)
        return false;
    return transmission * (has_textures && number != NONE ? texel_at_hit(hit, number, 0.0).x : 1.0) > 0.5;
}

// Returns the number of the surface at a hit, as surface_number(). Surfaces that are seen through are specular.
uint surface_of(Hit hit) {
    uint object = hit.object;
    uint material = objects[object].material, model = materials[material].model, kind = SCATTERING_SURFACE;
    if (objects[object].role != VIRTUAL)
        kind = REAL_SURFACE;
    else if (is_seen_through(hit))
        kind = SPECULAR_SURFACE;
    else if (model == METAL || model == METALLIC_ROUGHNESS || (model == GLASS && materials[material].roughness > 0.0))
        kind = GLOSSY_SURFACE;
    else if (model == MIRROR || model == GLASS)
        kind = SPECULAR_SURFACE;
    return 4u * (object + 1u) + kind;
}
