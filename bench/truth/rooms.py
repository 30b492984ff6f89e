# SPDX-License-Identifier: Apache-2.0
"""The rooms of tools/bench truth: lamps, surfaces, real objects, virtual objects and cameras, for Blender (render.py)
and for arhost (scenes.py).

World coordinates: mm, x right, y back, z up, origin at the centre of the marker on the table. Colours are linear light,
Rec. 709. Powers are in W, as Blender defines them: a point lamp has the radiant intensity power / 4π, a rectangle the
radiance power / (π · area)."""
import math
from dataclasses import dataclass, field

WIDTH, HEIGHT, FOCAL_PX = 512, 384, 480
MARKER_SIDE_MM, PAPER_MM = 80, 120
TABLE_SIZE, TABLE_CENTRE = (1400, 900), (0, 120)  # mm


@dataclass
class Lamp:
    kind: str  # rectangle, sphere or spot
    position: tuple
    power: float
    colour: tuple
    target: tuple = (0, 0, 0)  # rectangle, spot: the point at which the lamp is aimed
    size: tuple = (0, 0)  # rectangle
    radius: float = 0  # sphere, spot
    outer_degrees: float = 0  # spot: half angle
    blend: float = 0  # spot: the outer share of the cone in which the light fades


@dataclass
class Room:
    name: str
    table: str  # a surface of render.py
    lamps: list
    table_roughness: float = 0  # of its gloss, as arhost gets it; 0: matt
    walls: tuple = ()  # albedo; (): outdoors
    sky: float = 0  # radiance of an overcast sky at the zenith
    near_walls: tuple = ()  # albedo of walls beside and behind the objects, of which arhost is not told
    tall_objects: bool = False  # real objects that reach the lamps


@dataclass
class Thing:
    """A virtual object."""
    name: str
    material: str
    shape: str  # sphere, cuboid or bunny
    centre: tuple
    size: float  # radius of a sphere, side of a cuboid, height of the bunny
    turn_degrees: float = 0


MATERIALS = {
    "matt": {"kind": "dielectric", "colour": (0.62, 0.56, 0.47), "roughness": 1.0, "specular": 0},
    "glossy": {"kind": "dielectric", "colour": (0.55, 0.03, 0.025), "roughness": 0.25, "specular": 1},
    "rough metal": {"kind": "metal", "colour": (0.94, 0.68, 0.28), "roughness": 0.35},
    "mirror": {"kind": "metal", "colour": (0.95, 0.95, 0.95), "roughness": 0.0},
    "clear glass": {"kind": "glass", "colour": (1, 1, 1), "distance": None},
    "coloured glass": {"kind": "glass", "colour": (0.1, 0.75, 0.2), "distance": 25},  # colour after this distance, mm
    "emissive": {"kind": "emissive", "colour": (1.0, 0.45, 0.08), "radiance": 2.0},
}

THINGS = [
    Thing("bunny", "matt", "bunny", (-78, 35, 0), 80, 20),
    Thing("cube", "glossy", "cuboid", (76, 40, 17), 34, 28),
    Thing("mirror ball", "mirror", "sphere", (12, 78, 26), 26),
    Thing("gold ball", "rough metal", "sphere", (-48, -38, 17), 17),
    Thing("clear ball", "clear glass", "sphere", (14, -34, 20), 20),
    Thing("green ball", "coloured glass", "sphere", (64, -18, 17), 17),
    Thing("glow", "emissive", "cuboid", (-4, -84, 9), 18, 40),
]

ROOMS = [
    Room("window", "wood", [Lamp("rectangle", (-1750, 350, 650), 80, (0.80, 0.90, 1.0), (0, 350, 650), size=(1300, 1400))],
         walls=(0.72, 0.70, 0.66)),
    Room("night", "cloth", [Lamp("sphere", (330, 250, 330), 6.0, (1.0, 0.62, 0.28), radius=40),
                            Lamp("rectangle", (-620, 260, 620), 7.0, (0.25, 0.42, 1.0), (0, 0, 0), size=(320, 320))],
         walls=(0.35, 0.33, 0.30)),
    Room("overcast", "stone", [], sky=1.1),
    Room("spot", "lacquer", [Lamp("spot", (-330, 220, 900), 34, (1.0, 0.86, 0.68), (0, 20, 0), radius=40, outer_degrees=24,
                                  blend=0.35)], table_roughness=0.3, walls=(0.5, 0.48, 0.45)),
]

# Rooms for which nothing was adjusted: bricks in a hazy sun, dark granite close to coloured walls, a desk with many lamps.
OTHER_ROOMS = [
    Room("haze", "brick", [Lamp("sphere", (-65800, 40300, 63700), 630000, (1.0, 0.93, 0.82), radius=5240)], sky=0.45),
    Room("counter", "granite", [Lamp("rectangle", (20, 150, 240), 0.9, (1.0, 0.95, 0.88), (20, 120, 0), size=(500, 14)),
                                Lamp("spot", (270, -130, 420), 6.0, (1.0, 0.72, 0.42), (0, 10, 0), radius=14, outer_degrees=30,
                                     blend=0.3)],
         table_roughness=0.12, walls=(0.5, 0.48, 0.45), near_walls=((0.60, 0.12, 0.05), (0.10, 0.45, 0.20))),
    Room("lab", "plaster", [Lamp("rectangle", (150, 200, 1650), 6.5, (0.92, 0.97, 1.0), (150, 200, 0), size=(1600, 600)),
                            Lamp("sphere", (-290, 130, 150), 0.64, (1.0, 0.80, 0.55), radius=6),
                            Lamp("sphere", (-120, 330, 240), 0.72, (0.75, 0.85, 1.0), radius=6),
                            Lamp("sphere", (240, 190, 120), 0.56, (1.0, 0.55, 0.30), radius=6),
                            Lamp("sphere", (310, -60, 200), 0.56, (0.85, 1.0, 0.80), radius=6),
                            Lamp("spot", (-200, -150, 260), 1.44, (0.45, 0.60, 1.0), (-30, 0, 10), radius=5, outer_degrees=28,
                                 blend=0.4),
                            Lamp("spot", (120, 260, 300), 1.92, (1.0, 0.90, 0.75), (20, 20, 10), radius=5, outer_degrees=22,
                                 blend=0.2),
                            Lamp("sphere", (30, -260, 110), 0.32, (1.0, 0.35, 0.65), radius=4)],
         walls=(0.78, 0.78, 0.76), tall_objects=True),
]

# Azimuth (0: from the front) and elevation in degrees, distance in mm, of the camera from LOOK_AT.
LOOK_AT = (0, 10, 15)
VIEWS = [(-14, 36, 520), (22, 30, 560), (3, 56, 480), (48, 26, 540)]
MOVING_FRAMES = 24


@dataclass
class Camera:
    eye: tuple
    look_at: tuple = LOOK_AT
    up: tuple = field(default=(0, 0, 1))


def camera(azimuth_degrees, elevation_degrees, distance_mm):
    azimuth, elevation = math.radians(azimuth_degrees), math.radians(elevation_degrees)
    return Camera((LOOK_AT[0] + distance_mm * math.cos(elevation) * math.sin(azimuth),
                   LOOK_AT[1] - distance_mm * math.cos(elevation) * math.cos(azimuth),
                   LOOK_AT[2] + distance_mm * math.sin(elevation)))


def camera_of(view):
    """`view`: an index into VIEWS as text, or `m` and the number of a frame of the moving camera."""
    if not view.startswith("m"):
        return camera(*VIEWS[int(view)])
    at = int(view[1:]) / (MOVING_FRAMES - 1)
    return camera(-25 + 50 * at, 30 + 14 * math.sin(math.pi * at), 560 - 60 * at)
