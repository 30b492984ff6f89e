"""@NAME@: a source for arhost. It gives a gradient that moves."""
import time

import arhost
import numpy as np


class @CLASS@:
    # The arguments after `host` are given in the YAML: options: {arguments: '{"frames": 0}'}
    def __init__(self, host, width=640, height=360, frames=60):
        self.host = host  # host.info("…") logs, host.cancelled() tells when to give up
        self.width, self.height, self.frames = width, height, frames  # frames 0: endless

    def start(self, setup):
        # FILL IN: open the device or the file.
        self.fps = setup.fps or 30
        self.paced = setup.paced  # mode live
        self.began = time.monotonic() - setup.first_sequence / self.fps
        columns, rows = np.meshgrid(np.arange(self.width), np.arange(self.height))
        self.picture = np.stack([columns, rows, np.full_like(rows, 128)], axis=2)
        return {"width": self.width, "height": self.height, "fps": self.fps, "frame_count": self.frames,
                "pixel_format": arhost.RGB8, "clock": arhost.CLOCK_MEDIA}  # of a camera: CLOCK_MONOTONIC

    def read(self, buffer):
        n = buffer.sequence
        if self.frames and n >= self.frames:
            return None  # no more frames
        while self.paced and time.monotonic() < self.began + n / self.fps:
            if self.host.cancelled():
                raise arhost.Failure("", arhost.ERROR_CANCELLED)  # whatever waits asks this
            time.sleep(0.002)
        # FILL IN: your pixels. The grey plane that trackers see is made of them by arhost.
        buffer.planes[0][...] = (self.picture + [4 * n, 0, 0]).astype(np.uint8)
        return int(1e9 * n / self.fps)  # the capture time in ns, of the clock named in start
