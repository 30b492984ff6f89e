// SPDX-License-Identifier: Apache-2.0
//
// Random numbers of the path integrator, identical to rt_embree's (kernel/path_random.inl): an Owen-scrambled Sobol
// sequence (B. Burley, Practical Hash-based Owen Scrambling, JCGT 9(4), 2020) of samples, which each pixel shifts by
// another one of pixels in Z order (A. Ahmed and P. Wonka, Screen-space Blue-noise Diffusion of Monte Carlo Sampling
// Error via Hierarchical Ordering of Pixels, ACM TOG 39(6), 2020).

const uint SOURCE_DIMENSION = 64u, LIGHT_DIMENSION = 65u, SCATTER_DIMENSION = 66u, CHOICE_DIMENSION = 67u,
           ROULETTE_DIMENSION = 68u, PHOTON_DIMENSION = 69u, FACET_DIMENSION = 70u;
const uint TILE_PIXELS = 1024u;

// Permutes the numbers so that bit i of the result depends on the bits 0 to i of `x` only (S. Laine and T. Karras,
// Stratified Sampling for Stochastic Transparency, EGSR 2011; constants of Burley).
uint nested_permutation(uint x, uint seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    return x ^ (x * 0x8d22f6e6u);
}

// Returns the bits of Sobol's second dimension in reverse order, from the index: the Pascal matrix modulo 2.
uint pascal_of(uint index) {
    index ^= (index >> 1) & 0x55555555u;
    index ^= (index >> 2) & 0x33333333u;
    index ^= (index >> 4) & 0x0f0f0f0fu;
    index ^= (index >> 8) & 0x00ff00ffu;
    return index ^ ((index >> 16) & 0x0000ffffu);
}

// Returns the point with this index of a two-dimensional sequence, as 32 bits after the binary point.
uvec2 owen_pair(uint index, uint seed) {
    uint shuffled = bitfieldReverse(nested_permutation(bitfieldReverse(index), seed ^ 0x2545f491u));
    return uvec2(bitfieldReverse(nested_permutation(shuffled, seed)),
                 bitfieldReverse(nested_permutation(pascal_of(shuffled), hash(seed))));
}

// Returns the number in Z order of a pixel of a tile of full width; in others, a permutation of the numbers.
uint z_order_of(uint pixel) {
    return (pixel & 0x219u) | ((pixel & 0x22u) << 1) | ((pixel >> 1) & 0x82u) | ((pixel >> 2) & 0x20u) |
           ((pixel & 0x40u) << 2);
}

// Returns pair `index` of the `count` pairs that a sample needs for a dimension of a vertex. `random.pixel`: the number
// of the pixel in its tile, plus TILE_PIXELS times the plane; the bits from 12 on are the vertex.
vec2 path_pair(Random random, uint dimension, uint index, uint count) {
    uint vertex = random.pixel & ~4095u, number = random.pixel & 4095u;
    uint seed = hash(hash(hash(random.seed) + vertex) + dimension);
    uvec2 bits = owen_pair(random.number * count + index, seed) ^ owen_pair(z_order_of(number), hash(seed + (number >> 10)));
    return vec2(bits >> 8) * (1.0 / 16777216.0);
}
