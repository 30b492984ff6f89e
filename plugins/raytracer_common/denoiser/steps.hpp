// SPDX-License-Identifier: Apache-2.0
//
// The steps of the denoiser, compiled once per instruction set.
#pragma once

#include "raytracer_common/denoiser/layers.hpp"
#include "raytracer_common/instruction_set.hpp"

namespace arhost::raytracer_common {

// Each works on one row: of a layer, or of the image.
struct Steps {
    using OfLayer = void (*)(const Denoising &denoising, const Layer &layer, std::int32_t row);
    OfLayer find_change, accumulate;
    void (*filter)(const Denoising &denoising, const Layer &layer, std::int32_t row, int pass);
    // Returns the bounding rectangle of the pixels that virtual objects affect.
    Rectangle (*resolve)(const Denoising &denoising, std::int32_t row);
};

namespace base {
Steps steps();
}
namespace avx2 {
Steps steps();
}
namespace avx512 {
Steps steps();
}
Steps steps_of(InstructionSet instructions);

} // namespace arhost::raytracer_common
