# SPDX-License-Identifier: Apache-2.0
"""Camera noise, regions and differences of tools/bench truth."""
import zlib

import flip_evaluator
import numpy as np
from skimage.metrics import structural_similarity

import rooms

SHOT_NOISE, READ_NOISE = 4e-5, 4e-6  # variance = SHOT_NOISE · light + READ_NOISE: about one code
CHANGE_CODES = 1.0  # the virtual objects change a pixel if plate and truth, without noise, differ by more
METRICS = ("codes", "PSNR", "SSIM", "FLIP", "false")


def encoded(light):
    """Linear light as sRGB codes, not rounded."""
    light = np.clip(light[..., :3], 0, 1)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def photo(light, room, view):
    """What a camera with noise makes of linear light. The noise is the same in all pictures of a view."""
    seed = [zlib.crc32(room.encode()), int(view.lstrip("m"))] + [1] * view.startswith("m")
    rng = np.random.default_rng(seed)
    light = light[..., :3]
    noise = rng.standard_normal(light.shape) * np.sqrt(SHOT_NOISE * np.maximum(light, 0) + READ_NOISE)
    return np.round(encoded(light + noise)).astype(np.uint8)


def blurred(picture):
    """The mean over 5×5 pixels."""
    padded = np.pad(picture, [(2, 2), (2, 2), (0, 0)], mode="edge")
    sums = np.pad(padded.cumsum(0).cumsum(1), [(1, 0), (1, 0), (0, 0)])
    return (sums[5:, 5:] - sums[:-5, 5:] - sums[5:, :-5] + sums[:-5, :-5]) / 25


def areas(plate, truth, hits):
    """Where the virtual objects change the picture, and the index of the thing that each pixel belongs to: the one that is
    visible there, otherwise the nearest one."""
    difference = blurred(np.abs(encoded(truth) - encoded(plate))).max(-1)
    nearest = np.stack([np.linalg.norm(hits["points"] - np.array(thing.centre), axis=-1) - thing.size
                        for thing in rooms.THINGS]).argmin(0)
    is_thing = hits["labels"] >= 0
    return (difference > CHANGE_CODES) | is_thing, np.where(is_thing, hits["labels"], nearest)


def compare(pictures, truths, views):
    """The differences by material, "all" of them, and the change outside of the region."""
    error, flip, similar, owner, changed = [], [], [], [], []
    for picture, truth, (region, things) in zip(pictures, truths, views):
        error.append(np.abs(picture.astype(float) - truth))
        flip.append(flip_evaluator.evaluate(truth / np.float32(255), picture / np.float32(255), "LDR", applyMagma=False)[0][..., 0])
        similar.append(structural_similarity(truth, picture, channel_axis=2, full=True)[1].mean(-1))
        owner.append(things)
        changed.append(region)
    error, flip, similar, owner, changed = map(np.stack, (error, flip, similar, owner, changed))
    found = {}
    for name in ("all", *rooms.MATERIALS):
        things = [i for i, thing in enumerate(rooms.THINGS) if name in ("all", thing.material)]
        region = changed & np.isin(owner, things)
        if region.any():
            found[name] = {"codes": error[region].mean(), "PSNR": 10 * np.log10(255 ** 2 / max((error[region] ** 2).mean(), 1e-9)),
                           "SSIM": similar[region].mean(), "FLIP": flip[region].mean(), "pixels": int(region.sum())}
    found["all"]["false"] = error[~changed].mean()
    return {name: {key: float(value) for key, value in row.items()} for name, row in found.items()}


def print_tables(results):
    names = list(next(iter(results.values())))
    for metric in METRICS:
        print(f"\n{metric}" + " " * (20 - len(metric)) + "".join(f"{room:>12}" for room in results) + f"{'mean':>12}")
        for name in names:
            values = [result[name]["all"][metric] for result in results.values()]
            print(f"{name:20}" + "".join(f"{value:12.3f}" for value in [*values, np.mean(values)]))
    materials = [each for each in rooms.MATERIALS if each in results[next(iter(results))][names[0]]]
    print("\ncodes by material, mean of the rooms\n" + " " * 20 + "".join(f"{each:>16}" for each in materials))
    for name in names:
        print(f"{name:20}" + "".join(f"{np.mean([result[name][each]['codes'] for result in results.values() if each in result[name]]):16.2f}"
                                     for each in materials))
