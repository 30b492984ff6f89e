// SPDX-License-Identifier: Apache-2.0
//
// Deterministic sampling, identical to rt_embree's (kernel/random.inl): all pixels use the same low-discrepancy
// sequence, each with its own offset.

const uint ENVIRONMENT_PURPOSE = 1u, GLASS_PURPOSE = 2u, ROUGH_PURPOSE = 3u, FIRST_LAMP_PURPOSE = 4u;

struct Random {
    uint pixel, seed; // select the sequence
    uint number;      // of the sample in its pixel
};

// C. Wellons' 32-bit hash "lowbias32".
uint hash(uint x) {
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

// In [0, 1) (R2: M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
vec2 pair(Random random, uint purpose, uint index, uint count) {
    uint offset = hash(random.pixel ^ random.seed);
    uint i = random.number * count + index;
    uvec2 bits = uvec2(hash(offset + purpose * 2u) + i * 3242174889u, hash(offset + purpose * 2u + 1u) + i * 2447445414u);
    return vec2(bits >> 8) * (1.0 / 16777216.0);
}

// rt_embree numbers pixels by tiles of 32×32 px and blocks of 4×4 px in them.
Random random_of_pixel(uvec2 position, uint number) {
    uvec2 tile = position & ~31u, within = position - tile;
    uint blocks_across = (min(32u, frame.width - tile.x) + 3u) / 4u;
    uint block = within.y / 4u * blocks_across + within.x / 4u;
    uint lane = within.y % 4u * 4u + within.x % 4u;
    return Random(block * 16u + lane, (tile.x * 65536u + tile.y) ^ 0x51ed270bu, number);
}
