// SPDX-License-Identifier: Apache-2.0
//
// Calls the shading functions of arhost/shading/leaf/ with packets of 16 lanes, for comparison with their scalar
// versions. Each namespace has the call_leaf that is compiled for one instruction set, like the kernel.
#pragma once

namespace arhost::raytracer_common {

constexpr int packet_lanes = 16, max_arguments = 16, max_results = 3;
struct alignas(64) Packet {
    float lane[packet_lanes];
};

// `number` is an index into the array leaf_functions of leaf_calls.inl.
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

} // namespace arhost::raytracer_common
