// SPDX-License-Identifier: Apache-2.0
// This file is compiled once per instruction set (ARHOST_ISA), with the kernel's options. It must not include headers
// of the standard library: the linker could use their inline functions, compiled for this instruction set, in code
// for other processors.
#include "leaf_packets.hpp"

#include "raytracer_common/packets/packet.hpp"

namespace arhost::raytracer_common::ARHOST_ISA {
namespace {
#include "leaf_calls.inl"
}

void call_leaf(int number, const Packet (&arguments)[max_arguments], Packet (&results)[max_results]) {
    Float from[max_arguments], to[max_results]{};
    for (int i = 0; i < max_arguments; ++i)
        from[i] = load(arguments[i].lane);
    leaf_functions[number].call(from, to);
    for (int i = 0; i < max_results; ++i)
        store(results[i].lane, to[i]);
}

} // namespace arhost::raytracer_common::ARHOST_ISA
