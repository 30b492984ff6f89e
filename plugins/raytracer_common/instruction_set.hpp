// SPDX-License-Identifier: Apache-2.0
//
// The instruction sets for which SIMD code is compiled (packets/packet.hpp).
#pragma once

#include <string>

namespace arhost::raytracer_common {

enum class InstructionSet { base, avx2, avx512 };

// Values of the option `instruction_set`.
inline constexpr const char *instruction_sets[] = {"auto", "avx512", "avx2", "base", nullptr};

// "auto" chooses the one with the widest registers that this processor supports. Throws Failure if the processor or
// this build does not support `wanted`.
InstructionSet choose_instruction_set(const std::string &wanted);

} // namespace arhost::raytracer_common
