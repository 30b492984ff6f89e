# SPDX-License-Identifier: Apache-2.0
"""The request loop of the peers. Importing it redirects their own output to stderr."""
import json
import os
import sys
import time

import numpy as np

answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
os.dup2(2, 1)


def answer(what):
    print(json.dumps(what), file=answers, flush=True)


def serve(version, render, picture):
    """Answers each line "DEGREES SAMPLES SEED QUALITY FILE": calls render(degrees, samples, seed, quality) and prints its
    wall and CPU time; then saves picture(), linear RGB, to FILE."""
    answer({"version": version})
    for line in sys.stdin:
        degrees, samples, seed, quality, file = line.split()
        begin, cpu_begin = time.perf_counter(), time.process_time()
        render(float(degrees), int(samples), int(seed), quality)
        cpu, wall = time.process_time() - cpu_begin, time.perf_counter() - begin
        np.save(file, np.asarray(picture(), np.float32))
        answer({"wall_ms": 1e3 * wall, "cpu_ms": 1e3 * cpu})
