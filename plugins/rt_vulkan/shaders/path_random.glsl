// SPDX-License-Identifier: Apache-2.0
//
// Random numbers of the path integrator, identical to rt_embree's (kernel/path_random.inl): an Owen-scrambled Sobol
// sequence (B. Burley, Practical Hash-based Owen Scrambling, JCGT 9(4), 2020), with other scramblings for each pixel,
// vertex and dimension.

const uint SOURCE_DIMENSION = 64u, LIGHT_DIMENSION = 65u, SCATTER_DIMENSION = 66u, CHOICE_DIMENSION = 67u,
           ROULETTE_DIMENSION = 68u;

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

// Returns pair `index` of the `count` pairs that a sample needs for a dimension of a vertex. `random.pixel` includes the
// vertex.
vec2 path_pair(Random random, uint dimension, uint index, uint count) {
    uint seed = hash(hash(random.pixel + hash(random.seed)) + dimension), i = random.number * count + index;
    uint shuffled = bitfieldReverse(nested_permutation(bitfieldReverse(i), seed ^ 0x2545f491u));
    uvec2 bits = uvec2(bitfieldReverse(nested_permutation(shuffled, seed)),
                       bitfieldReverse(nested_permutation(pascal_of(shuffled), hash(seed))));
    return vec2(bits >> 8) * (1.0 / 16777216.0);
}
