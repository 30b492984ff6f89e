"""@NAME@: a ray tracer for arhost. It draws one sphere that fills the scene's bounds."""
import arhost
import numpy as np


def normalised(a):
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def srgb_bytes(linear):
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)
    return (255 * np.clip(encoded, 0, 1) + 0.5).astype(np.uint8)


class @CLASS@:
    # The arguments after `host` are given in the YAML: options: {arguments: '{"colour": [0, 0.5, 1]}'}
    def __init__(self, host, colour=(0.8, 0.3, 0.1)):
        self.host = host  # host.info("…") logs, host.cancelled() tells when to give up
        self.colour = np.array(colour)  # linear light

    def start(self, setup):
        # FILL IN: read setup.scene.objects and geometries (arhost/scene.h), build what makes rays fast.
        low, high = setup.scene.bounds_min.astype(float), setup.scene.bounds_max.astype(float)
        self.centre = (low + high) / 2
        self.radius = (high - low).min() / 2

    def render(self, request, image):
        camera, lens = request.camera, request.camera.intrinsics
        back = normalised(camera.eye - camera.look_at)
        right = normalised(np.cross(camera.up, back))
        up = np.cross(back, right)

        # Pixel centres are at integers, rows run downwards, the camera looks along -back.
        rows, columns = np.mgrid[0:image.shape[0], 0:image.shape[1]]
        x, y = (columns - lens.cx) / lens.fx, (rows - lens.cy) / lens.fy
        directions = normalised(x[..., None] * right - y[..., None] * up - back)

        from_centre = camera.eye - self.centre
        b = directions @ from_centre
        discriminant = b * b - from_centre @ from_centre + self.radius ** 2
        distances = -b - np.sqrt(np.maximum(discriminant, 0))
        hits = (discriminant >= 0) & (distances > 0)

        # FILL IN: your shading. This is a lamp at the camera.
        normals = (from_centre + distances[hits, None] * directions[hits]) / self.radius
        light = 0.1 - 0.9 * (normals * directions[hits]).sum(axis=1)
        image[...] = 0  # alpha exactly 0 where no ray hit: the video shows
        image[hits, :3] = srgb_bytes(light[:, None] * self.colour)
        image[hits, 3] = 255  # were it less, the colour would still not be multiplied by it
