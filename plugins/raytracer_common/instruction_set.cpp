// SPDX-License-Identifier: Apache-2.0
#include "raytracer_common/instruction_set.hpp"

#include <arhost-cpp/plugin.hpp>

namespace arhost::raytracer_common {

InstructionSet choose_instruction_set(const std::string &wanted) {
    const auto requested = [&](const char *name) { return wanted == name || wanted == "auto"; };
#if defined(__x86_64__)
    if (requested("avx512") && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
        return InstructionSet::avx512;
    if (requested("avx2") && __builtin_cpu_supports("avx2"))
        return InstructionSet::avx2;
#endif
    if (requested("base"))
        return InstructionSet::base;
    throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                  "option 'instruction_set': this processor or this build does not support '" + wanted +
                      "'; use 'auto'");
}

} // namespace arhost::raytracer_common
