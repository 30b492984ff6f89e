/* SPDX-License-Identifier: Apache-2.0 */
/* arhost/arhost.h: the whole C ABI. */
#ifndef ARHOST_ARHOST_H
#define ARHOST_ARHOST_H
#include "camera.h"
#include "control.h"
#include "counters.h"
#include "devices.h"
#include "frame.h"
#include "plugin.h"
#include "raytracer.h"
#include "scene.h"
#include "sink.h"
#include "source.h"
#include "tracker.h"
#endif
