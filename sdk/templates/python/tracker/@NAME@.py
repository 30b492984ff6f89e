"""@NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid is
its centre, their number its area. arhost computes the pose from the corners."""
import arhost
import numpy as np


class @CLASS@:
    # Arguments after `host` come from the YAML: options: {arguments: '{"threshold": 220}'}
    def __init__(self, host, threshold=200):
        self.host = host  # host.info("…") logs; poll host.cancelled() in long loops
        self.threshold = threshold

    def start(self, setup):
        self.marker = setup.markers[0]  # the first configured marker; this tracker does not look for others

    def track(self, frame):
        """FILL IN: your detector."""
        rows, columns = np.nonzero(frame.grey >= self.threshold)
        if len(rows) < 100:
            return []  # no marker in this frame: not an error
        half = np.sqrt(len(rows)) / 2
        # Top left, top right, bottom right, bottom left on the upright print.
        corners = [columns.mean(), rows.mean()] + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return [arhost.Observation(self.marker.id, corners, self.marker.family)]
