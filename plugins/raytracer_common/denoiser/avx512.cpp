// SPDX-License-Identifier: Apache-2.0
#define ARHOST_ISA avx512
#include "raytracer_common/denoiser/steps.inl"
