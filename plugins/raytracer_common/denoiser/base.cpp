// SPDX-License-Identifier: Apache-2.0
#define ARHOST_ISA base
#include "raytracer_common/denoiser/steps.inl"
