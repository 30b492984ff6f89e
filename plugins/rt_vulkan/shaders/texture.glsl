// SPDX-License-Identifier: Apache-2.0
//
// Textures, which are stored in a buffer. The shader computes bilinear filtering, because hardware samplers differ in
// rounding.

// Maps the texel index `i`, which may be outside the texture, to an index inside it.
int wrapped(int i, int size, uint wrap) {
    if (wrap == WRAP_CLAMP)
        return clamp(i, 0, size - 1);
    int period = wrap == WRAP_MIRROR ? 2 * size : size;
    int repeats = int(floor((float(i) + 0.5) * (1.0 / float(period))));
    int within = i - repeats * period;
    return wrap == WRAP_MIRROR && within >= size ? period - 1 - within : within;
}

// Returns a texel's linear colour and alpha. `at`: its index in the image.
vec4 texel_at(uint number, uint at) {
    uint first = textures[number].first_texel;
    if (textures[number].format == TEXEL_RGBA32F) {
        first += 4u * at;
        return uintBitsToFloat(uvec4(texels[first], texels[first + 1u], texels[first + 2u], texels[first + 3u]));
    }
    uint code = texels[first + at];
    uvec4 bytes = uvec4(code, code >> 8, code >> 16, code >> 24) & 255u;
    vec4 linear = vec4(bytes) * (1.0 / 255.0);
    if (textures[number].format == TEXEL_SRGB8)
        linear.rgb = uintBitsToFloat(uvec3(tables[FIRST_LIGHT_OF_CODE + bytes.x], tables[FIRST_LIGHT_OF_CODE + bytes.y],
                                           tables[FIRST_LIGHT_OF_CODE + bytes.z]));
    return linear;
}

// Reduces a far coordinate to an equivalent one near 0, so that integer texel coordinates don't overflow.
float reduced(float t, uint wrap) {
    if (wrap == WRAP_CLAMP)
        return clamp(t, -1.0, 2.0);
    float bounded = clamp(t, -1e6, 1e6);
    return bounded - 2.0 * floor(bounded * 0.5);
}

// Samples a level of a texture.
vec4 sample_level(uint number, int level, vec2 texcoord) {
    uint wrap_u = textures[number].wrap_u, wrap_v = textures[number].wrap_v, first = 0u;
    int width = textures[number].width, height = textures[number].height;
    for (int i = 0; i < level; ++i) {
        first += uint(width * height);
        width = max(width >> 1, 1);
        height = max(height >> 1, 1);
    }
    vec2 at = vec2(reduced(texcoord.x, wrap_u), reduced(texcoord.y, wrap_v)) * vec2(width, height);
    bool is_nearest = textures[number].is_nearest != 0u;
    at -= is_nearest ? 0.0 : 0.5;
    vec2 corner = floor(at), weights = is_nearest ? vec2(0.0) : at - corner;
    int x0 = wrapped(int(corner.x), width, wrap_u), x1 = wrapped(int(corner.x) + 1, width, wrap_u);
    int y0 = wrapped(int(corner.y), height, wrap_v), y1 = wrapped(int(corner.y) + 1, height, wrap_v);
    vec4 a = texel_at(number, first + uint(y0 * width + x0)), b = texel_at(number, first + uint(y0 * width + x1));
    vec4 c = texel_at(number, first + uint(y1 * width + x0)), d = texel_at(number, first + uint(y1 * width + x1));
    vec4 top = a + (b - a) * weights.x, bottom = c + (d - c) * weights.x;
    return top + (bottom - top) * weights.y;
}

// Samples a texture with its filter. `area`: that a sample covers, in the unit of u times that of v; 0: the largest
// level.
vec4 sample_texture(uint number, vec2 texcoord, float area) {
    float texels = area * float(textures[number].width) * float(textures[number].height);
    float level = min(0.5 * log2(clamp(texels, 1.0, 1e30)), float(textures[number].level_count - 1u));
    float lower = floor(level), weight = level - lower;
    vec4 sum = vec4(0.0);
    // A loop rather than two calls, because the code is long.
    for (int i = 0; i < (weight > 0.0 ? 2 : 1); ++i) {
        vec4 texel = sample_level(number, int(lower) + i, texcoord);
        sum = i == 0 ? texel : sum + (texel - sum) * weight;
    }
    return sum;
}
