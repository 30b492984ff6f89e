"""@NAME@: a sink for arhost. It writes each frame as a picture, <path>000000.ppm and so on."""
import os

import arhost


class @CLASS@:
    # Further arguments are given in the YAML: options: {arguments: '{"name": "value"}'}
    def __init__(self, host):
        self.host = host  # host.info("…") logs, host.cancelled() tells when to give up

    def start(self, setup):
        self.path, self.part = setup.path, setup.path + ".part"
        # Where nothing can be written this tells so now. It leaves what is there as it is until the first frame:
        # another component may yet refuse the run.
        os.makedirs(os.path.dirname(self.path), exist_ok=True)
        open(self.part, "wb").close()
        os.remove(self.part)

    def write(self, output):
        """FILL IN: what becomes of a frame. output.record tells its pose, its time and how its overlay arose."""
        name = f"{self.path}{output.record.sequence:06}.ppm"
        with open(self.part, "wb") as file:
            file.write(b"P6\n%d %d\n255\n" % (output.width, output.height))
            file.write(output.bgr[:, :, ::-1].tobytes())
        os.replace(self.part, name)  # under its own name only when it is whole
