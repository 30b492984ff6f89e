# SPDX-License-Identifier: Apache-2.0
"""Shared by the peers: the scene written by rt-embree-peers, and the request loop."""
import json
import os
import sys
import time

import numpy as np


class Scene:
    def __init__(self, folder):
        with open(os.path.join(folder, "scene.json"), encoding="utf-8") as file:
            self.__dict__.update(json.load(file))

        def read(name, kind):
            return np.fromfile(os.path.join(folder, name), kind).reshape(-1, 3)

        self.positions = read("positions.f32", np.float32)
        self.normals = read("normals.f32", np.float32)
        self.indices = read("triangles.u32", np.uint32)


def serve(folder, hello, render, image, rays, own_ms=None):
    """Answers each input line with a line of JSON.

    "CASE FRAMES": times of that many calls of render(case, seed), and own_ms(case, seed).
    "image CASE": writes image(case, samples), linear RGBA, to FOLDER/NAME-CASE.f32.
    "rays CASE": rays(case), the rays per frame."""
    # Redirect the peer's own output to stderr.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def answer(what):
        print(json.dumps(what), file=answers, flush=True)

    answer(hello)
    seed = 0
    for line in sys.stdin:
        first, second = line.split()
        if first == "image":
            image(second, 4).astype(np.float32).tofile(os.path.join(folder, f"{hello['short']}-{second}.f32"))
            answer({})
        elif first == "rays":
            answer({"rays": rays(second)})
        else:
            for _ in range(3):  # warm-up: compiles kernels, builds acceleration structures
                seed += 1
                render(first, seed)
            wall, cpu = [], []
            for _ in range(int(second)):
                seed += 1
                begin, cpu_begin = time.perf_counter(), time.process_time()
                render(first, seed)
                cpu.append(1e3 * (time.process_time() - cpu_begin))
                wall.append(1e3 * (time.perf_counter() - begin))
            answer({"wall_ms": wall, "cpu_ms": cpu, "own_ms": [own_ms(first, seed)] if own_ms else []})
