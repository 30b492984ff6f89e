#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The light of rt_embree's path integrator compared with Mitsuba 3: tools/bench light [--quick], or
bench/light/light.py [--quick] [CASE…]. Method: bench/light/README.md.

CASE: the beginning of a name. Exits with 1 if a target is missed."""
import json
import os
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
sys.path.insert(0, os.path.join(root, "bench", "peers"))
import peers  # noqa: E402

PACKAGES = {"mitsuba": "3.9.1", "pillow": "13.0.0", "numpy": None}
peers.enter(PACKAGES, needs_llvm=True)

import numpy as np  # noqa: E402
from PIL import Image, ImageDraw  # noqa: E402

import cases  # noqa: E402
import reference  # noqa: E402

QUICK = "--quick" in sys.argv
NAMES = [word for word in sys.argv[1:] if not word.startswith("--")]
FOLDER = os.path.join(root, "build", "light")
SHARED = os.path.join(root, "..", "shared", "data")
PROGRAM = os.path.join(peers.binaries, "render-light")
CELL, SMALLEST_CELL = 40, 150  # px: side, and number of pixels of an object
SPEED_TARGET = 1.5


def ours(case, width, height, samples, frames=1, **keys):
    """(added light, transmittance, CPU seconds)"""
    name = "".join(each if each.isalnum() else "-" for each in case.name)
    path, out = os.path.join(FOLDER, name + ".yaml"), os.path.join(FOLDER, name + ".f32")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(case.scene, file)  # YAML contains JSON
    words = [path, out, width, height, case.focal, *case.eye, *case.at, 0, 1, 0, samples, frames, "max_radiance=0",
             *(f"{key}={value}" for key, value in keys.items())]
    answer = json.loads(subprocess.run([PROGRAM, *map(str, words)], stdout=subprocess.PIPE, text=True, check=True).stdout)
    values = np.fromfile(out, np.float32).reshape(height, width, 6).astype(np.float64)
    os.remove(out)
    return values[..., :3], values[..., 3:], answer["cpu_s"]


def difference(light, truth, least=0):
    """The relative difference of the channel that differs most. A channel that is darker than `least` or a tenth of the
    brightest one counts as if it was not."""
    each = (light - truth) / np.maximum(truth, max(least, 0.1 * truth.max()))
    return each[np.abs(each).argmax()]


class Region:
    """An object, and the part of it that differs most."""

    def __init__(self, name, light, truths, mask):
        self.name = name
        truth = truths.mean(0)
        self.light, self.truth = light[mask].mean(0), truth[mask].mean(0)
        self.difference = difference(self.light, self.truth)
        self.noise = self.noise_of(truths, mask)
        self.worst, self.worst_noise = self.difference, self.noise
        for y in range(0, mask.shape[0], CELL):
            for x in range(0, mask.shape[1], CELL):
                part = np.zeros_like(mask)
                part[y:y + CELL, x:x + CELL] = mask[y:y + CELL, x:x + CELL]
                if part.sum() < SMALLEST_CELL:
                    continue
                least = 0.1 * self.truth.max()
                here = difference(light[part].mean(0), truth[part].mean(0), least)
                if abs(here) > abs(self.worst):
                    self.worst, self.worst_noise = here, self.noise_of(truths, part, least)

    @staticmethod
    def noise_of(truths, mask, least=0):
        """Standard error of the reference, relative as in difference()."""
        means = truths[:, mask].mean((1, 2))
        return means.std(ddof=1) / np.sqrt(len(means)) / max(means.mean(), least) if len(means) > 1 else 0

    def verdict(self, tolerance):
        """Noise excuses no difference above the target, but it may be the reason for one."""
        if max(abs(self.difference), abs(self.worst)) <= tolerance:
            return "met"
        is_noise = abs(self.difference) <= tolerance + 3 * self.noise and abs(self.worst) <= tolerance + 4.5 * self.worst_noise
        return "NOT SHOWN: too noisy" if is_noise else "MISSED"


def compared(case):
    """Regions, and our picture and the reference."""
    width, height = cases.WIDTH, cases.HEIGHT
    scale = 8 if QUICK else 1
    samples = case.samples // scale
    case.reference_samples //= scale
    added, transmittance, seconds = ours(case, width, height, samples)
    if callable(case.reference):
        truths, without = case.reference(case)[None], np.zeros_like(added)
    else:
        truths, without = reference.pictures(case, FOLDER, width, height)
    light = added + transmittance * without
    objects = reference.regions(case, FOLDER, width, height)
    found = []
    for number, thing in enumerate(case.scene["objects"]):
        mask = objects == number
        if mask.sum() >= SMALLEST_CELL and (case.regions is None or thing["name"] in case.regions):
            found.append(Region(thing["name"], light, truths, mask))
    shown = (objects >= 0)[..., None]
    return found, light * shown, truths.mean(0) * shown, seconds


def strip(case, light, truth):
    """Ours, the reference and the difference: red where ours is 20 % brighter, blue where it is darker."""
    white = np.percentile(truth, 98)
    encode = lambda a: np.clip(a / max(white, 1e-9), 0, 1) ** (1 / 2.2)  # noqa: E731
    relative = np.clip((light - truth).mean(-1) / np.maximum(truth.mean(-1), 0.02 * white) / 0.2, -1, 1)
    signed = np.stack([1 + np.minimum(relative, 0), 1 - np.abs(relative), 1 - np.maximum(relative, 0)], -1)
    image = Image.fromarray((255 * np.concatenate([encode(light), encode(truth), signed], 1) + 0.5).astype(np.uint8))
    ImageDraw.Draw(image).text((3, 2), case.name, fill=(255, 220, 0))
    return image


def write_sheet(strips, columns=3):
    width, height = strips[0].size
    rows = -(-len(strips) // columns)
    sheet = Image.new("RGB", (columns * (width + 6), rows * (height + 6)), (40, 40, 40))
    for i, each in enumerate(strips):
        sheet.paste(each, (i % columns * (width + 6), i // columns * (height + 6)))
    sheet.save(os.path.join(FOLDER, "light.png"))


def relative_error(picture, truth):
    """Mean squared error relative to the light; dark pixels count as if they had a tenth of the mean light."""
    return ((picture - truth) ** 2 / np.maximum(truth, 0.1 * truth.mean()) ** 2).mean()


def frames_in_sequence(case):
    """The mean of 256 pictures of one sample and the picture of 256 samples, relative to the noise of either."""
    width, height = 80, 60
    case.focal /= 2
    many, one = (ours(case, width, height, *each)[0] for each in ((1, 256), (256, 1)))
    half = ours(case, width, height, 1, 128)[0]  # the mean of the frames differs from it by about the noise of 256 samples
    case.focal *= 2
    noise = np.sqrt(((many - half) ** 2).mean())
    return many.mean() / one.mean() - 1, np.sqrt(((many - one) ** 2).mean()) / noise


def speed(case, samples=32):
    """Mitsuba's error² · CPU time, relative to ours."""
    width, height, many = cases.WIDTH, cases.HEIGHT, 16 if QUICK else 64
    rounds = 2 if QUICK else 6
    our_truth = ours(case, width, height, samples * many)[0]
    runs = [ours(case, width, height, samples, threads=2, light_samples=1) for _ in range(rounds)]  # as Mitsuba
    our_time, our_error = min(each[2] for each in runs), relative_error(runs[0][0], our_truth)
    case.reference_samples = samples * many
    their_truth = reference.pictures(case, FOLDER, width, height)[0].mean(0)
    pictures, seconds = reference.timed(case, FOLDER, width, height, samples, rounds)
    their_time, their_error = min(seconds), np.mean([relative_error(each, their_truth) for each in pictures])
    return our_error, our_time, their_error, their_time


def environments():
    found = [(name, path, intensity) for name, intensity in (("studio_small_03", 0.5), ("venice_sunset", 1))
             if os.path.exists(path := os.path.abspath(os.path.join(SHARED, "env", f"{name}_1k.hdr")))]
    if not found:
        sky = np.ones((64, 128, 3)) * [0.4, 0.5, 0.7]
        sky[12:20, 40:56] = 20
        cases.write_hdr(sky, os.path.join(FOLDER, "sky.hdr"))
        found = [("a sky", "sky.hdr", 1)]
    return found


def main():
    os.makedirs(FOLDER, exist_ok=True)
    wanted = lambda name: not NAMES or any(name.startswith(each) for each in NAMES)  # noqa: E731
    missed, results, strips = [], [], []
    print("light: rt_embree's path integrator compared with Mitsuba, linear light without bound; the worst part: of "
          f"{CELL}x{CELL} px\n  {'case':32} {'region':14} {'ours':>9} {'reference':>9} {'difference':>10} {'noise':>6}   "
          f"{'worst part':>10} {'noise':>6}   target")
    for case in cases.all_cases(FOLDER, environments()):
        if not wanted(case.name):
            continue
        regions, light, truth, _ = compared(case)
        strips.append(strip(case, light, truth))
        for each in regions:
            verdict = each.verdict(case.tolerance)
            if verdict != "met":
                missed.append(f"{case.name}, {each.name}" + (" (too noisy)" if verdict.startswith("NOT") else ""))
            results.append({"case": case.name, "region": each.name, "ours": each.light.tolist(), "truth": each.truth.tolist(),
                            "difference": each.difference, "noise": each.noise, "worst": each.worst, "worst_noise": each.worst_noise,
                            "verdict": verdict})
            print(f"  {case.name:32} {each.name:14} {each.light.mean():9.4f} {each.truth.mean():9.4f} {each.difference:+10.2%} "
                  f"{each.noise:6.2%}   {each.worst:+10.2%} {each.worst_noise:6.2%}   {case.tolerance:.0%}: {verdict}", flush=True)
    if strips:
        write_sheet(strips)
    if wanted("frames"):
        mean, ratio = frames_in_sequence(cases.cornell("frames", [cases.AREA_LAMP]))
        off = abs(mean) > 0.005 or ratio > 2
        print(f"  256 frames of one sample compared with one of 256: mean {mean:+.2%}, difference {ratio:.2f} times the noise: "
              f"{'MISSED' if off else 'met'}")
        if off:
            missed.append("256 frames of one sample")
    if wanted("speed"):
        name, image, intensity = environments()[0]
        for case in [cases.cornell("Cornell, area lamp", [cases.AREA_LAMP], samples=0),
                     *cases.bunny(f"bunny in {name}", SHARED, FOLDER, {"image": image, "intensity": intensity})]:
            our_error, our_time, their_error, their_time = speed(case)
            ratio = their_error * their_time / (our_error * our_time)
            results.append({"case": case.name, "speed": ratio, "error": [our_error, their_error], "cpu_s": [our_time, their_time]})
            print(f"  speed, {case.name}: error² {our_error:.3g} in {our_time:.3f} s of CPU time; Mitsuba {their_error:.3g} in "
                  f"{their_time:.3f} s: {ratio:.2f} times as fast (target: {SPEED_TARGET}: "
                  f"{'met' if ratio >= SPEED_TARGET else 'MISSED'})", flush=True)
            if ratio < SPEED_TARGET:
                missed.append(f"speed, {case.name}")
    with open(os.path.join(FOLDER, "light.json"), "w", encoding="utf-8") as out:
        json.dump(results, out, indent=1)
    print("  pictures (ours, reference, difference: red where ours is brighter): build/light/light.png")
    if missed:
        raise SystemExit("light: missed: " + "; ".join(missed))


if __name__ == "__main__":
    main()
