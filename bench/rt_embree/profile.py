#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""CPU profile of rt_embree by part of the renderer: profile.py [PROGRAM]

Runs each case of rt-embree-bench, or of PROGRAM (e.g. an older version), under Linux perf and sums up the samples by
part (half a minute). The fractions hardly depend on other load."""
import collections
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
CASES = ["primary", "diffuse", "mirror", "glass"]
# The first match counts. Most of the kernel is inlined into these functions.
PARTS = [("inside Embree", r"libembree"), ("hit surfaces, textures", r"surface_at"),
         ("lamps and shadow rays", r"direct_light|catcher_shadow"), ("materials", r"shade"),
         ("rays, queues, pixels", r"render_tile"), ("threads, clearing, start", r"")]


def profile(program, case):
    with tempfile.NamedTemporaryFile() as data:
        subprocess.run(["perf", "record", "-o", data.name, "-F", "999", "--", program, "0",
                        "auto", case], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        report = subprocess.run(["perf", "report", "-i", data.name, "--stdio", "-F", "overhead,dso,symbol", "--no-children",
                                 "-t", "|"], check=True, capture_output=True, text=True).stdout
    shares = collections.Counter()
    for line in report.splitlines():
        found = re.match(r"\s*([\d.]+)%?\s*\|(.*)\|(.*)", line)
        if found:
            where = found[2] + " " + found[3]
            shares[next(name for name, pattern in PARTS if re.search(pattern, where))] += float(found[1])
    return shares


def main():
    program = next((word for word in sys.argv[1:] if word != "--quick"), ROOT / "build/release/bin/rt-embree-bench")
    if not shutil.which("perf"):
        raise SystemExit("perf is not installed: apt-get install linux-perf")
    rows = {case: profile(program, case) for case in CASES}
    print("rt_embree, the bunny of 69,451 triangles, 800x600, 1 sample: share of CPU time, %")
    print(f"  {'':26}" + "".join(f"{case:>10}" for case in CASES))
    for name, _ in PARTS:
        print(f"  {name:26}" + "".join(f"{rows[case][name]:10.1f}" for case in CASES))


main()
