#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Time per frame of rt_embree's path integrator, denoised, by pixels, triangles, lamps, covered share of the picture and
samples: tools/bench growth [--quick]. Method: bench/growth/README.md."""
import math
import os
import statistics
import struct
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
FOLDER = os.path.join(root, "build", "growth")
PROGRAM = os.path.join(root, "build", "release", "bin", "render-noise")
PLOT = os.path.join(root, "docs", "images", "growth.svg")
QUICK = "--quick" in sys.argv

SIZES_PX = ((640, 480), (960, 720), (1920, 1080), (2560, 1440), (3840, 2160))
TRIANGLES = (5_000, 50_000, 500_000, 2_000_000, 10_000_000)
LAMP_GRIDS = ((1, 1), (2, 2), (2, 4), (4, 4), (8, 8), (5, 13), (16, 16), (25, 40))
# The ball covers 0, 1, 10, 25, 50, 78 and 100 % of the picture. Its centre is 373 mm from the camera.
RADII_MM = (0, 15, 47, 73, 101, 128, 205)
BALL_RADIUS_MM = 88
SAMPLES = (1, 2, 4, 8, 16)

# In a scene with mirrors or glass, the first 16 frames trace photons; the median of more than 32 frames is one of those
# that do not.
FRAMES, FRAMES_WITHOUT_PHOTONS = (3, 3) if QUICK else (33, 9)

BALL_CENTRE_MM = (0, 0, 25)  # the point at which render-noise's camera looks
LAMP_CENTRE_MM, LAMP_DIRECTION, LAMP_SIDE_MM, LAMP_INTENSITY = (-400, -200, 500), (0.6, 0.3, -0.75), 250, 350_000


def write(name, text):
    path = os.path.join(FOLDER, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def unit(a):
    length = math.hypot(*a)
    return [x / length for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def lamps(columns, rows):
    """The lamp of bench/noise/scene.yaml, cut into equal parts, so that the picture stays the same."""
    along_u = unit(cross(LAMP_DIRECTION, (0, 0, 1)))
    along_v = unit(cross(LAMP_DIRECTION, along_u))
    text = "lights:\n"
    for column in range(columns):
        for row in range(rows):
            u, v = (LAMP_SIDE_MM * ((i + 0.5) / n - 0.5) for i, n in ((column, columns), (row, rows)))
            position = [round(c + u * a + v * b, 4) for c, a, b in zip(LAMP_CENTRE_MM, along_u, along_v)]
            text += (f"  - {{type: rectangle, position: {position}, direction: {list(LAMP_DIRECTION)}, "
                     f"size: [{LAMP_SIDE_MM / columns}, {LAMP_SIDE_MM / rows}], "
                     f"intensity: {LAMP_INTENSITY / columns / rows}, falloff: inverse-square}}\n")
    return text


def table_scene(columns=1, rows=1):
    """bench/noise/scene.yaml with several lamps."""
    with open(os.path.join(root, "bench", "noise", "scene.yaml"), encoding="utf-8") as file:
        text = file.read()
    begin, end = text.index("lights:\n"), text.index("objects:\n")
    return write(f"table-{columns}x{rows}.yaml", text[:begin] + lamps(columns, rows) + text[end:])


def write_ball(path, triangles, radius_mm):
    """Writes the dented ball of bench/bunny.hpp. Returns its number of triangles."""
    rings = round(math.sqrt(triangles / 2))
    sides = rings + 1
    angles = [2 * math.pi * side / sides for side in range(sides)]
    around = [(math.cos(angle), math.sin(angle), math.cos(8 * angle)) for angle in angles]
    x0, y0, z0 = BALL_CENTRE_MM
    with open(path, "wb") as file:
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {(rings + 1) * sides}\nproperty float x\n"
                   f"property float y\nproperty float z\nelement face {2 * rings * sides}\n"
                   "property list uint uint vertex_indices\nend_header\n".encode())
        for ring in range(rings + 1):
            theta = math.pi * ring / rings
            sine, cosine, dent = math.sin(theta), math.cos(theta), 0.12 * math.sin(9 * theta)
            row = []
            for x, y, wave in around:
                r = radius_mm * (1 + dent * wave)
                row += (x0 + r * sine * x, y0 + r * sine * y, z0 + r * cosine)
            file.write(struct.pack(f"<{len(row)}f", *row))
        for first in range(0, rings * sides, sides):
            row = []
            for side in range(sides):
                a, b = first + side, first + (side + 1) % sides
                row += (3, a, a + sides, b, 3, b, a + sides, b + sides)
            file.write(struct.pack(f"<{len(row)}I", *row))
    return 2 * rings * sides


def ball_scene(triangles, radius_mm):
    """A dented ball on a table; only the table if the radius is 0. Returns the file and the number of triangles."""
    name = f"ball-{triangles}-{radius_mm}"
    count = write_ball(os.path.join(FOLDER, name + ".ply"), triangles, radius_mm)
    ball = f"  - {{name: ball, mesh: {name}.ply, smooth: true, material: white}}\n" if radius_mm else ""
    return write(name + ".yaml", f"""version: 2
axes: z-up
max_depth: 6
background: [0.35, 0.38, 0.42]
materials:
  desk: {{model: diffuse, diffuse: 0.4}}
  white: {{model: diffuse, diffuse: 0.75}}
{lamps(1, 1)}
objects:
  - {{name: desk, plane: {{size: 1200, centre: [0, 0, {BALL_CENTRE_MM[2] - 1.12 * radius_mm:.2f}]}}, material: desk, role: catcher}}
{ball}"""), count


def output(scene, **keys):
    return subprocess.run([PROGRAM, scene, *(f"{key}={value}" for key, value in keys.items())],
                          stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()


def render(scene, frames, **keys):
    """Returns the wall and CPU time of a frame in ms."""
    words = output(scene, frames=frames, reference=0, **keys)[-1].split()
    return float(words[2]), float(words[6])


def covered_percent(scene):
    """Share of the picture that shows virtual objects."""
    rows = [line.rsplit(maxsplit=3) for line in output(scene, width=160, height=120, frames=1, reference=1)[1:-1]]
    pixels = {kind: int(count) for kind, count, *_ in rows}
    return 100 * (1 - sum(pixels.get(kind, 0) for kind in ("outside", "catcher")) / sum(pixels.values()))


def pixels_rows(values):
    for width, height in values:
        pixels = width * height
        # Photons are less than 2 % of the time of a larger picture.
        frames = FRAMES if pixels < 3e6 else FRAMES_WITHOUT_PHOTONS
        yield f"{width}×{height}", pixels / 1e6, render(table_scene(), frames, width=width, height=height)


def triangles_rows(values):
    for triangles in values:
        scene, count = ball_scene(triangles, BALL_RADIUS_MM)
        yield f"{count:,}", count, render(scene, FRAMES_WITHOUT_PHOTONS)


def lamps_rows(values):
    for columns, rows in values:
        count = columns * rows
        yield f"{count:,}", count, render(table_scene(columns, rows), FRAMES)


def share_rows(values):
    for radius_mm in values:
        # as many triangles per pixel for each size
        scene, _ = ball_scene(max(100, round(200_000 * (radius_mm / RADII_MM[-1]) ** 2)), radius_mm)
        percent = covered_percent(scene)
        yield f"{percent:.0f}", percent, render(scene, FRAMES_WITHOUT_PHOTONS)


def samples_rows(values):
    for samples in values:
        yield str(samples), samples, render(table_scene(), FRAMES, samples=samples)


# Title, label of the x axis, logarithmic axes, values, rows
PANELS = (("pixels", "size of the picture, px", True, SIZES_PX, pixels_rows),
          ("triangles", "number of triangles", True, TRIANGLES, triangles_rows),
          ("lamps", "number of lamps", True, LAMP_GRIDS, lamps_rows),
          ("covered share", "covered by virtual objects, %", False, RADII_MM, share_rows),
          ("samples", "samples per pixel", False, SAMPLES, samples_rows))
COLOURS = {"wall time": "#1f6fb2", "CPU time of all threads": "#c0392b"}
LEFT, TOP, WIDTH, HEIGHT, GAP_X, BELOW = 64, 64, 170, 170, 56, 84


def ticks_of(values, is_logarithmic):
    """Round numbers that include the values."""
    if not is_logarithmic:
        step = next(step for step in (m * 10 ** e for e in range(7) for m in (1, 2, 5)) if 5 * step >= max(values))
        return [step * i for i in range(math.ceil(max(values) / step) + 1)]
    steps = [m * 10 ** e for e in range(7) for m in (1, 2, 5)]
    low, high = max(s for s in steps if s <= min(values)), min(s for s in steps if s >= max(values))
    return [step for step in steps if low <= step <= high]


def draw(results):
    width = LEFT + len(PANELS) * (WIDTH + GAP_X) - GAP_X + 16
    height = TOP + HEIGHT + BELOW
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="11">',
           f'<rect width="{width}" height="{height}" fill="white"/>']
    for i, (label, colour) in enumerate(COLOURS.items()):
        svg.append(f'<path d="M{LEFT + 110 * i} 18h22" stroke="{colour}" stroke-width="2"/>'
                   f'<text x="{LEFT + 110 * i + 28}" y="22">{label}</text>')
    svg.append(f'<text transform="translate(12 {TOP + HEIGHT / 2}) rotate(-90)" text-anchor="middle">time per frame, ms</text>')
    for number, (title, axis, is_logarithmic, _, _) in enumerate(PANELS):
        rows, left = results[title], LEFT + number * (WIDTH + GAP_X)
        scaled = math.log if is_logarithmic else float
        ticks = ticks_of([time for row in rows for time in row[2:4]], is_logarithmic)
        x_low, x_high = scaled(rows[0][1]) if is_logarithmic else 0, scaled(rows[-1][1])
        y_low, y_high = scaled(ticks[0]), scaled(ticks[-1])

        def across(value):
            return left + 8 + (WIDTH - 16) * (scaled(value) - x_low) / (x_high - x_low)

        def level(value):
            return TOP + HEIGHT * (1 - (scaled(value) - y_low) / (y_high - y_low))

        svg.append(f'<text x="{left + WIDTH / 2}" y="{TOP - 10}" text-anchor="middle" font-weight="bold">{title}</text>')
        for tick in ticks:
            svg.append(f'<path d="M{left} {level(tick):.1f}h{WIDTH}" stroke="#ddd"/>'
                       f'<text x="{left - 5}" y="{level(tick) + 4:.1f}" text-anchor="end">{tick:,}</text>')
        svg.append(f'<rect x="{left}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#aaa"/>')
        for column, colour in zip((2, 3), COLOURS.values()):
            points = [f"{across(row[1]):.1f} {level(row[column]):.1f}" for row in rows]
            svg.append(f'<path d="M{"L".join(points)}" fill="none" stroke="{colour}" stroke-width="2"/>')
            svg += [f'<circle cx="{point.split()[0]}" cy="{point.split()[1]}" r="2.5" fill="{colour}"/>' for point in points]
        labelled = -math.inf
        for label, value, *_ in rows:
            if across(value) - labelled < 9:
                continue
            labelled = across(value)
            svg.append(f'<text transform="translate({labelled + 3:.1f} {TOP + HEIGHT + 12}) rotate(-50)" '
                       f'text-anchor="end" font-size="9">{label}</text>')
        svg.append(f'<text x="{left + WIDTH / 2}" y="{height - 8}" text-anchor="middle">{axis}</text>')
    return "\n".join(svg) + "\n</svg>\n"


def table(results):
    columns = max(map(len, results.values()))
    text = "| " * (columns + 1) + "|\n" + "| --- " * (columns + 1) + "|\n"
    for (_, axis, *_), rows in zip(PANELS, results.values()):
        labels, _, wall_ms, cpu_ms = zip(*rows)
        for name, values in ((f"**{axis}**", labels), ("wall time, ms", map("{:,.0f}".format, wall_ms)),
                             ("CPU time, ms", map("{:,.0f}".format, cpu_ms))):
            cells = [name, *values]
            text += "| " + " | ".join(cells + [""] * (columns + 1 - len(cells))) + " |\n"
    return text


def slopes(results):
    """How the CPU time grows."""
    def line(title, least=0):
        return statistics.linear_regression(*zip(*((row[1], row[3]) for row in results[title] if row[1] >= least)))

    per_pixel_ns = [row[3] / row[1] for row in results["pixels"]]
    few, many = results["triangles"][0], results["triangles"][-1]
    lamps_line, samples_line = line("lamps", least=65), line("samples")
    return (f"CPU time: {min(per_pixel_ns):.0f} to {max(per_pixel_ns):.0f} ns per pixel; "
            f"{many[1] / few[1]:,.0f} times as many triangles take {many[3] / few[3]:.1f} times as long; "
            f"{lamps_line.intercept:.0f} ms + {lamps_line.slope:.2f} ms per lamp (from 65 lamps on); "
            f"{samples_line.intercept:.0f} ms + {samples_line.slope:.0f} ms per sample\n")


def main():
    os.makedirs(FOLDER, exist_ok=True)
    results = {}
    for title, _, _, values, rows_of in PANELS:
        results[title] = []
        for label, value, (wall_ms, cpu_ms) in rows_of(values[:2] if QUICK else values):
            results[title].append((label, value, wall_ms, cpu_ms))
            print(f"{title}: {label}: wall time {wall_ms:.0f} ms, CPU time {cpu_ms:.0f} ms", flush=True)
    if QUICK:
        write("quick.svg", draw(results))
        return
    with open(PLOT, "w", encoding="utf-8") as file:
        file.write(draw(results))
    print("\n" + slopes(results))
    print("written:", write("table.md", table(results) + "\n" + slopes(results)), PLOT)


if __name__ == "__main__":
    main()
