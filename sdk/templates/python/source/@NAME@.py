"""@NAME@: a source for arhost. Produces a moving gradient."""
import time

import arhost
import numpy as np


class @CLASS@:
    # Arguments after `host` come from the YAML: options: {arguments: '{"frames": 0}'}
    def __init__(self, host, width=640, height=360, frames=60):
        self.host = host  # host.info("…") logs; poll host.cancelled() in long loops
        self.width, self.height, self.frames = width, height, frames  # frames 0: endless

    def start(self, setup):
        # FILL IN: open the device or file.
        self.fps = setup.fps or 30
        self.paced = setup.paced  # mode live
        self.start_time = time.monotonic() - setup.first_sequence / self.fps
        columns, rows = np.meshgrid(np.arange(self.width), np.arange(self.height))
        self.image = np.stack([columns, rows, np.full_like(rows, 128)], axis=2)
        return {"width": self.width, "height": self.height, "fps": self.fps, "frame_count": self.frames,
                "pixel_format": arhost.PIXEL_FORMAT_RGB8, "clock": arhost.CLOCK_MEDIA}  # for a camera: CLOCK_MONOTONIC

    def read(self, buffer):
        n = buffer.sequence
        if self.frames and n >= self.frames:
            return None  # no more frames
        while self.paced and time.monotonic() < self.start_time + n / self.fps:
            if self.host.cancelled():  # poll this in every wait
                raise arhost.Failure("", arhost.STATUS_ERROR_CANCELLED)
            time.sleep(0.002)
        # FILL IN: your pixels. arhost computes the grey plane for trackers from them.
        buffer.planes[0][...] = (self.image + [4 * n, 0, 0]).astype(np.uint8)
        return int(1e9 * n / self.fps)  # capture time, ns of the clock returned by start
