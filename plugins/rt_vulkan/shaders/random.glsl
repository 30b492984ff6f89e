// SPDX-License-Identifier: Apache-2.0
//
// Numbers that look random, the same in each run and as in rt_embree (kernel/random.inl): every pixel walks the same
// even sequence, each from a point of its own.

const uint ENVIRONMENT_PURPOSE = 1u, GLASS_PURPOSE = 2u, ROUGH_PURPOSE = 3u, FIRST_LAMP_PURPOSE = 4u;

struct Random {
    uint pixel, seed; // which sequence
    uint number;      // which of the pixel's
};

// A hash of 32 bits (C. Wellons' "lowbias32").
uint hash(uint x) {
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

// 0 to below 1 (R2: M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
vec2 pair(Random random, uint purpose, uint index, uint count) {
    uint own = hash(random.pixel ^ random.seed);
    uint i = random.number * count + index;
    uvec2 bits = uvec2(hash(own + purpose * 2u) + i * 3242174889u, hash(own + purpose * 2u + 1u) + i * 2447445414u);
    return vec2(bits >> 8) * (1.0 / 16777216.0);
}

// Sequences of a tile of 32×32 pixels and of the blocks of 4×4 in it, in which rt_embree numbers pixels.
Random random_of_pixel(uvec2 at, uint number) {
    uvec2 tile = at & ~31u, within = at - tile;
    uint blocks_across = (min(32u, frame.width - tile.x) + 3u) / 4u;
    uint block = within.y / 4u * blocks_across + within.x / 4u;
    uint lane = within.y % 4u * 4u + within.x % 4u;
    return Random(block * 16u + lane, (tile.x * 65536u + tile.y) ^ 0x51ed270bu, number);
}
