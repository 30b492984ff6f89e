"""Runs the plugin in arhost for five frames; all of them must pass through it: python3 test_@NAME@.py
Set ARHOST to the program's path if it is not in the PATH."""
import json
import os
import pathlib
import subprocess
import unittest

here = pathlib.Path(__file__).resolve().parent


class Try(unittest.TestCase):
    def test_five_frames_pass_through(self):
        subprocess.run([os.environ.get("ARHOST", "arhost"), "--config", "try.yaml", "--frames", "5"], cwd=here,
                       check=True)
        stats = json.loads((here / "out/stats.json").read_text())
        self.assertEqual(stats["frames"]["@COUNT@"], 5)


if __name__ == "__main__":
    unittest.main()
