# SPDX-License-Identifier: Apache-2.0
"""The scene of bench/noise and its cameras, for the peers."""
import math
import os

import yaml

here = os.path.dirname(os.path.abspath(__file__))
with open(os.path.join(here, "..", "noise", "scene.yaml"), encoding="utf-8") as file:
    SCENE = yaml.safe_load(file)
LOOK_AT = (0, 0, 25)  # mm


def eye(degrees):
    """As in bench/noise/render_noise.cpp."""
    return 330 * math.sin(math.radians(degrees)), -330 * math.cos(math.radians(degrees)), 200


def fov_y_degrees(width, height):
    """The focal length of render_noise.cpp is 1.15 widths."""
    return math.degrees(2 * math.atan(height / 2 / (1.15 * width)))


def triple(value):
    return [float(value)] * 3 if isinstance(value, (int, float)) else [float(each) for each in value]
