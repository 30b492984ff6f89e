// SPDX-License-Identifier: Apache-2.0
//
// Deterministic sampling, identical to rt_embree's (kernel/random.inl): all pixels use the same low-discrepancy
// sequence; each pixel starts at an offset that is a hash of its position.

const uint ENVIRONMENT_PURPOSE = 1u, GLASS_PURPOSE = 2u, ROUGH_PURPOSE = 3u, FIRST_LAMP_PURPOSE = 4u;

struct Random {
    uint pixel, seed; // determine the start of the sequence
    uint number;      // index among the samples of the pixel
};

// Returns a 32-bit hash of `x` ("lowbias32" by C. Wellons).
uint hash(uint x) {
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

// Returns pair `index` of the `count` pairs that a sample needs for `purpose`, in [0, 1) (R2 sequence: M. Roberts,
// The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
vec2 pair(Random random, uint purpose, uint index, uint count) {
    uint offset = hash(random.pixel ^ random.seed);
    uint i = random.number * count + index;
    uvec2 bits = uvec2(hash(offset + purpose * 2u) + i * 3242174889u, hash(offset + purpose * 2u + 1u) + i * 2447445414u);
    return vec2(bits >> 8) * (1.0 / 16777216.0);
}

// Returns the same Random as rt_embree, which numbers pixels within tiles of 32×32 px, block by block of 4×4 px.
Random random_of_pixel(uvec2 position, uint number) {
    uvec2 tile = position & ~31u, within = position - tile;
    uint blocks_across = (min(32u, frame.width - tile.x) + 3u) / 4u;
    uint block = within.y / 4u * blocks_across + within.x / 4u;
    uint lane = within.y % 4u * 4u + within.x % 4u;
    return Random(block * 16u + lane, (tile.x * 65536u + tile.y) ^ 0x51ed270bu, number);
}
