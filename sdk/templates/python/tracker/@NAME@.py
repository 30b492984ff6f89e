"""@NAME@: a tracker for arhost. Treats the bright pixels as one white square that faces the camera: their centroid
gives the direction, their area the distance."""
import arhost
import numpy as np


class @CLASS@:
    # Arguments after `host` come from the YAML: options: {arguments: '{"threshold": 220}'}
    def __init__(self, host, threshold=200):
        self.host = host  # host.info("…") logs; poll host.cancelled() in long loops
        self.threshold = threshold

    def start(self, setup):
        self.lens = setup.intrinsics
        self.target = setup.markers[0]  # the first configured marker; this tracker ignores the others

    def detect(self, grey):
        """FILL IN: your detector."""
        rows, columns = np.nonzero(grey >= self.threshold)
        return None if len(rows) < 100 else (columns.mean(), rows.mean(), len(rows))

    def track(self, frame, markers):
        patch = self.detect(frame.grey)
        if patch is None:
            return 0  # no marker in this frame: not an error
        x, y, area = patch
        half = np.sqrt(area) / 2
        distance = self.lens.fx * self.target.side_mm / (2 * half)

        marker = markers[0]
        marker["id"] = self.target.id
        marker["family"] = b"bright"
        marker["state"] = arhost.MARKER_DETECTED
        # Top left, top right, bottom right, bottom left on the upright print.
        marker["corners_px"] = np.array([x, y]) + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        # Marker to camera, column-major; camera axes x right, y up, looking along -z; mm. No rotation: frontal view.
        mt = np.eye(4)
        mt[:3, 3] = distance * (x - self.lens.cx) / self.lens.fx, -distance * (y - self.lens.cy) / self.lens.fy, -distance
        marker["mt"] = mt.T.reshape(16)
        return 1  # number of markers filled in
