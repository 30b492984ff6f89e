// SPDX-License-Identifier: Apache-2.0
#define ARHOST_ISA avx2
#include "kernel.inl"
