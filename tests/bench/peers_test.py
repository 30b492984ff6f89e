#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests of bench/peers/peers.py that need no peer."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bench/peers"))
import peers  # noqa: E402


class NewestLlvm(unittest.TestCase):
    def test_is_the_highest_major_version_whatever_the_naming_scheme(self):
        lib = "/usr/lib/x86_64-linux-gnu/"
        for libraries, expected in (
                ([], (0, None)),
                ([lib + "libLLVM-14.so.1", lib + "libLLVM-15.so"], (15, lib + "libLLVM-15.so")),
                ([lib + "libLLVM.so.19.1", lib + "libLLVM-15.so.1"], (19, lib + "libLLVM.so.19.1")),
                (["/usr/lib/llvm-9/lib/libLLVM.so", "/usr/lib/llvm-16/lib/libLLVM.so.1"],
                 (16, "/usr/lib/llvm-16/lib/libLLVM.so.1")),
                (["/usr/lib/llvm-19/lib/libLLVMCore.so", lib + "libLLVM-14.0.6.so.1"],
                 (14, lib + "libLLVM-14.0.6.so.1"))):
            self.assertEqual(peers.newest_llvm(libraries), expected)


if __name__ == "__main__":
    unittest.main()
