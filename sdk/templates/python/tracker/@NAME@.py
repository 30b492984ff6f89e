"""@NAME@: a tracker for arhost. It takes the brightest patch of the image for a white square that faces the camera:
its middle gives the direction, its area the distance."""
import arhost
import numpy as np


class @CLASS@:
    # The arguments after `host` are given in the YAML: options: {arguments: '{"threshold": 220}'}
    def __init__(self, host, threshold=200):
        self.host = host  # host.info("…") logs, host.cancelled() tells when to give up
        self.threshold = threshold

    def start(self, setup):
        self.lens = setup.intrinsics
        self.wanted = setup.markers[0]  # the first that the configuration lists: the only one that is looked for

    def detect(self, grey):
        """FILL IN: your detector."""
        rows, columns = np.nonzero(grey >= self.threshold)
        return None if len(rows) < 100 else (columns.mean(), rows.mean(), len(rows))

    def track(self, frame, markers):
        patch = self.detect(frame.grey)
        if patch is None:
            return 0  # nothing found is no error: the video goes on without an overlay
        x, y, area = patch
        half = np.sqrt(area) / 2
        distance = self.lens.fx * self.wanted.side_mm / (2 * half)

        marker = markers[0]
        marker["id"] = self.wanted.id
        marker["family"] = b"bright"
        marker["state"] = arhost.DETECTED
        # Top left, top right, bottom right, bottom left of the upright print.
        marker["corners_px"] = np.array([x, y]) + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        # Marker to camera, column-major, x right, y up, looking along -z, in mm. Not turned: it faces the camera.
        mt = np.eye(4)
        mt[:3, 3] = distance * (x - self.lens.cx) / self.lens.fx, -distance * (y - self.lens.cy) / self.lens.fy, -distance
        marker["mt"] = mt.T.reshape(16)
        return 1  # markers[0] is filled in
