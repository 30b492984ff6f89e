"""@NAME@: a sink for arhost. Writes each frame as an image: <path>000000.ppm, …"""
import os

import arhost


class @CLASS@:
    # Further arguments come from the YAML: options: {arguments: '{"name": "value"}'}
    def __init__(self, host):
        self.host = host  # host.info("…") logs; poll host.cancelled() in long loops

    def start(self, setup):
        self.path, self.temporary = setup.path, setup.path + ".part"
        # Report an unwritable path now, but leave existing files unchanged until the first frame: another component
        # may still reject the run.
        os.makedirs(os.path.dirname(self.path), exist_ok=True)
        open(self.temporary, "wb").close()
        os.remove(self.temporary)

    def write(self, output):
        """FILL IN: your output. output.record has the frame's pose, time and more."""
        name = f"{self.path}{output.record.sequence:06}.ppm"
        with open(self.temporary, "wb") as file:
            file.write(b"P6\n%d %d\n255\n" % (output.width, output.height))
            file.write(output.bgr[:, :, ::-1].tobytes())
        os.replace(self.temporary, name)  # atomic: only complete files get the final name
