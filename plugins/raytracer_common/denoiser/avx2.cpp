// SPDX-License-Identifier: Apache-2.0
#define ARHOST_ISA avx2
#include "raytracer_common/denoiser/steps.inl"
