# SPDX-License-Identifier: Apache-2.0
"""What the peers have in common: the scene that rt-embree-peers left, and the loop that answers its caller."""
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
    """Answers lines of the input with a line of JSON each.

    "CASE FRAMES": times of that many frames, render(case, seed); own_ms(case, seed), of one.
    "image CASE": leaves image(case, samples), linear RGBA, in FOLDER as NAME-CASE.f32.
    "rays CASE": rays(case), of a frame."""
    # What the peer prints is not an answer.
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
            for _ in range(3):  # compiles the kernels, builds what is built once
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
