#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws the CSV file of tracking-conditions: bench/tracking/plots.py FILE.csv FILE.svg"""
import csv
import math
import sys

COLOURS = {"tracker_apriltag": "#1f6fb2", "AprilTag": "#9cc3e2", "tracker_aruco": "#c0392b", "OpenCV": "#e6a79f"}
TRACKERS = ("tracker_apriltag", "tracker_aruco")
# Title, column, column of the bound, logarithmic, detectors
ROWS = (("found, %", "found", None, False, tuple(COLOURS)),
        ("noise of corners, px", "corner_px", None, True, tuple(COLOURS)),
        *((f"{name} {share}, {unit}", f"{column}_{share}", f"bound_of_{column}_{share}", True, tuple(COLOURS))
          for name, unit, column in (("rotation", "°", "rotation_degrees"), ("translation", "mm", "translation_mm"))
          for share in ("p50", "p95", "p99")),
        ("covered, %", "covered", None, False, TRACKERS))
TARGET_OF_COVERED = (90, 98)
LEFT, TOP, WIDTH, HEIGHT, GAP_X, GAP_Y = 70, 60, 130, 110, 14, 16


def axis(values, is_logarithmic):
    """Returns the ends of an axis and its ticks."""
    if not is_logarithmic:
        return 0, 100, (0, 25, 50, 75, 100)
    low, high = math.floor(math.log10(min(values))), math.floor(math.log10(max(values))) + 1
    return low, high, tuple(10.0 ** power for power in range(low, high + 1))


def draw(rows):
    dimensions = {}  # name: (unit, values in the order of the file)
    for row in rows:
        values = dimensions.setdefault(row["dimension"], (row["unit"], []))[1]
        if row["value"] not in values:
            values.append(row["value"])
    width = LEFT + len(dimensions) * (WIDTH + GAP_X) + 10
    height = TOP + len(ROWS) * (HEIGHT + GAP_Y) + 34
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="11">',
           f'<rect width="{width}" height="{height}" fill="white"/>']
    x = LEFT
    for label, colour in COLOURS.items():
        svg.append(f'<path d="M{x} 20h22" stroke="{colour}" stroke-width="2"/><text x="{x + 28}" y="24">{label}</text>')
        x += 145
    svg.append(f'<path d="M{x} 20h22" stroke="#555" stroke-width="1.5" stroke-dasharray="4 3"/>'
               f'<text x="{x + 28}" y="24">an estimator at the Cramér–Rao bound</text>')
    for number, (title, column, bound, is_logarithmic, detectors) in enumerate(ROWS):
        top = TOP + number * (HEIGHT + GAP_Y)
        shown = [float(row[name]) for row in rows for name in (column, bound)
                 if name and row["detector"] in detectors and float(row[name]) > 0]
        low, high, ticks = axis(shown, is_logarithmic)

        def level(value):
            share = ((math.log10(value) if is_logarithmic else value) - low) / (high - low)
            return top + HEIGHT * (1 - min(max(share, 0), 1))

        svg.append(f'<text transform="translate(16 {top + HEIGHT / 2}) rotate(-90)" text-anchor="middle">{title}</text>')
        for tick in ticks:
            svg.append(f'<text x="{LEFT - 6}" y="{level(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>')
        for place, (dimension, (unit, values)) in enumerate(dimensions.items()):
            left = LEFT + place * (WIDTH + GAP_X)

            def across(value):
                return left + WIDTH * (values.index(value) + 0.5) / len(values)

            if number == 0:
                svg.append(f'<text x="{left + WIDTH / 2}" y="{TOP - 10}" text-anchor="middle" font-weight="bold">{dimension}'
                           f'{", " + unit if unit else ""}</text>')
            if column == "covered":
                high_y, low_y = level(TARGET_OF_COVERED[1]), level(TARGET_OF_COVERED[0])
                svg.append(f'<rect x="{left}" y="{high_y:.1f}" width="{WIDTH}" height="{low_y - high_y:.1f}" fill="#dff0d8"/>')
            for tick in ticks:
                svg.append(f'<path d="M{left} {level(tick):.1f}h{WIDTH}" stroke="#ddd"/>')
            svg.append(f'<rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#aaa"/>')
            for detector in detectors:
                own = [row for row in rows if row["dimension"] == dimension and row["detector"] == detector]
                for name, style in ((column, 'stroke-width="2"'), (bound, 'stroke-width="1.5" stroke-dasharray="4 3"')):
                    if not name or (name == bound and detector not in TRACKERS):
                        continue
                    # a cell in which nothing is found has neither errors nor noise
                    points = [f'{across(row["value"]):.1f} {level(float(row[name])):.1f}' for row in own
                              if name == "found" or float(row["found"]) > 0 and (float(row[name]) > 0 or not is_logarithmic)]
                    if points:
                        svg.append(f'<path d="M{"L".join(points)}" fill="none" stroke="{COLOURS[detector]}" {style}/>')
            if number == len(ROWS) - 1:
                for value in values:
                    x, y = across(value), top + HEIGHT + 12
                    svg.append(f'<text transform="translate({x + 3:.1f} {y}) rotate(-60)" text-anchor="end" font-size="9">'
                               f'{float(value):g}</text>')
    return "\n".join(svg) + "\n</svg>\n"


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as source:
        picture = draw(list(csv.DictReader(source)))
    with open(sys.argv[2], "w", encoding="utf-8") as target:
        target.write(picture)
