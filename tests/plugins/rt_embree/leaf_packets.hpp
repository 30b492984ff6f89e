// SPDX-License-Identifier: Apache-2.0
//
// The kernel's leaf functions on packets of 16 lanes, per instruction set.
#pragma once

namespace rt_embree {

constexpr int packet_lanes = 16, max_arguments = 16, max_results = 3;
struct alignas(64) Packet {
    float lane[packet_lanes];
};

// `number`: index into leaf_functions of leaf_calls.inl.
using CallLeaf = void (*)(int number, const Packet (&arguments)[max_arguments], Packet (&results)[max_results]);

namespace base {
void call_leaf(int number, const Packet (&arguments)[max_arguments], Packet (&results)[max_results]);
}
namespace avx2 {
void call_leaf(int number, const Packet (&arguments)[max_arguments], Packet (&results)[max_results]);
}
namespace avx512 {
void call_leaf(int number, const Packet (&arguments)[max_arguments], Packet (&results)[max_results]);
}

} // namespace rt_embree
