#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the brightness of metal spheres of roughness 0 to 1 in image-based light with Mitsuba's `path` integrator:
`tools/bench metal`, or `bench/peers/metal.py IMAGE.hdr…`. Method: bench/peers/README.md.

Exits with 1 if a sphere of a ray tracer differs by more than 5 %."""
import json
import math
import os
import subprocess
import sys

import peers

view = os.path.join(peers.binaries, "arhost-view")
shared = os.path.join(peers.root, "..", "shared", "data", "env")
roughnesses = [0, 0.25, 0.5, 0.75, 1]
samples = 64
largest_difference = 0.05


def write_sun(path):
    """A dim sky with a sun of 5 degrees that gives most of the light, as an uncompressed Radiance file."""
    width, height = 256, 128
    with open(path, "wb") as file:
        file.write(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode())
        for y in range(height):
            theta = math.pi * (y + 0.5) / height
            for x in range(width):
                phi = 2 * math.pi * (x + 0.5) / width - 4
                cosine = math.sin(theta) * math.sin(1) * math.cos(phi) + math.cos(theta) * math.cos(1)
                value = 300 if cosine > math.cos(math.radians(2.5)) else 0.1 + 0.2 * (cosine > 0)
                mantissa, exponent = math.frexp(value)
                file.write(bytes([int(256 * mantissa)] * 3 + [exponent + 128]))


def main():
    arguments = [word for word in sys.argv[1:] if word != "--quick"]
    if not os.path.exists(view):
        raise SystemExit("metal: build/release/bin/arhost-view is missing: run tools/bench metal")
    os.makedirs(peers.folder, exist_ok=True)
    peers.install({name: peers.packages.get(name) for name in ("mitsuba", "pillow", "numpy")})
    images = [os.path.abspath(path) for path in arguments]
    if not images:
        images = [path for name in ("studio_small_03_1k.hdr", "st_fagans_interior_1k.hdr")
                  if os.path.exists(path := os.path.join(shared, name))]
        images.append(os.path.join(peers.folder, "sun.hdr"))
        write_sun(images[-1])

    def peer(*words):
        return json.loads(subprocess.run(
            [peers.venv_python, os.path.join(peers.here, "peer_metal.py"), *map(str, words)], stdout=subprocess.PIPE,
            text=True, check=True).stdout)

    missed = False
    print(f"metal: light of metal spheres relative to Mitsuba's path, {samples} samples (target: within "
          f"{100 * largest_difference:.0f} %)")
    print(f"  {'environment':26} {'ray tracer':10} " + " ".join(f"{r:>6}" for r in roughnesses) + "   roughness")
    for image in images:
        name = os.path.splitext(os.path.basename(image))[0]
        intensity = peer("intensity", image)
        scene = os.path.join(peers.folder, f"metal-{name}.yaml")
        with open(scene, "w", encoding="utf-8") as file:
            file.write(f"version: 1\naxes: y-up\nmax_depth: 8\nenvironment: {{image: {json.dumps(image)}, "
                       f"intensity: {intensity:g}}}\nmaterials:\n")
            for i, roughness in enumerate(roughnesses):
                file.write(f"  m{i}: {{model: metallic-roughness, roughness: {roughness}}}\n")
            file.write("objects:\n")
            for i in range(len(roughnesses)):
                file.write(f"  - {{sphere: {{centre: [{60 * i - 120}, 0, 0], radius: 25}}, material: m{i}}}\n")
        pictures = []
        for tracer in ("rt_embree", "rt_vulkan"):
            picture = os.path.join(peers.folder, f"metal-{name}-{tracer}.png")
            run = subprocess.run([view, scene, "--raytracer", tracer, "--eye=0,0,300", "--look-at=0,0,0", "--size=640x160",
                                  "--fov=30", f"--samples={samples}", "--transparent", "--output", picture],
                                 stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
            if run.returncode == 0:
                pictures.append((tracer, picture))
            elif tracer == "rt_vulkan": # it needs a Vulkan device
                print(f"  {name:26} {tracer:10} is skipped: {run.stderr.strip()}")
            else:
                raise SystemExit(f"metal: {tracer} fails: {run.stderr.strip()}")
        ratios = peer("compare", image, intensity, json.dumps(roughnesses), *(picture for _, picture in pictures))
        for (tracer, _), by_sphere in zip(pictures, ratios):
            off = max(abs(ratio - 1) for ratio in by_sphere) > largest_difference
            missed |= off
            print(f"  {name:26} {tracer:10} " + " ".join(f"{ratio:6.3f}" for ratio in by_sphere)
                  + ("   MISSED" if off else ""))
    print(f"  pictures: {os.path.relpath(peers.folder, peers.root)}/metal-*.png (below each other: the ray tracers, Mitsuba)")
    if missed:
        raise SystemExit("metal: a sphere differs from Mitsuba's by more than 5 %")


main()
