# SPDX-License-Identifier: Apache-2.0
"""Rig time of cameras' clocks, against rigcal's own code, and the way back."""

import json
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np

import rig_cases
from rigcal import Calibration, RigcalError

START_NS = 1_700_000_000_000_000_000


def rig_with_clocks():
    rig = rig_cases.rig()
    corners = [(100, 0.0), (200, 0.004), (201, -0.3), (300, 0.25)]
    clocks = [
        {"time_offset_s": -0.008046},
        {"time_offset_s": 0.5, "time_rate_ppm": 42.7, "time_epoch_s": START_NS / 1e9 + 60},
        {"clock_course": [{"camera_time_ns": str(START_NS + s * 10**9), "offset_s": offset}
                          for s, offset in corners]},
        {"line_delay_s": 1.7e-5, "time_offset_s": 1e-4},
        {"line_delay_s": -1.7e-5, "time_rate_ppm": -3.0,
         "clock_course": [{"camera_time_ns": START_NS, "offset_s": -0.125}]},
    ]
    for camera, clock in zip(rig["cameras"], clocks):
        camera.update(clock)
    return rig


class Clocks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = rig_with_clocks()
        cls.calibration = Calibration.from_json(json.dumps(cls.rig))
        random = np.random.default_rng(2)
        cls.times = START_NS + random.integers(-50 * 10**9, 400 * 10**9, 2000)
        cls.rows = random.uniform(0, 1023, 2000)

    def test_are_those_of_the_programs_to_the_nanosecond(self):
        theirs = rig_cases.reference(
            self.rig, times_ns=self.times.tolist(), y_px=self.rows.tolist())["cameras"]
        moved = 0
        for name in self.calibration.cameras:
            ours = self.calibration.rig_time(name, self.times, self.rows)
            np.testing.assert_array_equal(ours, theirs[name]["rig_times_ns"], name)
            moved += (ours != self.times).any()
        self.assertEqual(moved, 5)

    def test_the_way_back(self):
        for name in self.calibration.cameras:
            there = self.calibration.rig_time(name, self.times, self.rows)
            back = self.calibration.camera_time(name, there, self.rows)
            # Where the clock ran at another rate, several moments have one rig time.
            again = self.calibration.rig_time(name, back, self.rows)
            self.assertLessEqual(np.abs(again - there).max(), 1, name)
            self.assertLessEqual(np.abs(back - self.times).max(), 2, name)

    def test_shapes(self):
        name = self.calibration.cameras[0]
        self.assertEqual(self.calibration.rig_time(name, START_NS).shape, ())
        self.assertEqual(self.calibration.camera_time(name, START_NS).shape, ())
        grid = self.times.reshape(40, 50)
        self.assertEqual(self.calibration.rig_time(name, grid).shape, (40, 50))
        self.assertEqual(self.calibration.camera_time(name, grid).shape, (40, 50))
        self.assertEqual(self.calibration.camera_time(name, []).shape, (0,))

    def test_seconds_are_refused(self):
        name = self.calibration.cameras[0]
        with self.assertRaisesRegex(TypeError, "camera_time_ns must be integers, nanoseconds"):
            self.calibration.rig_time(name, [1.5])
        with self.assertRaisesRegex(ValueError, r"y_px must be one number or \(3,\), got \(2,\)"):
            self.calibration.rig_time(name, [1, 2, 3], [1.0, 2.0])

    def test_a_file_without_clocks_says_so(self):
        with tempfile.TemporaryDirectory() as folder:
            path = rig_cases.write(rig_cases.rig(), Path(folder))
            subprocess.run([rig_cases.program("rigcal"), "calibration", "import", path,
                            "--output", f"{folder}/opencv"], check=True, capture_output=True)
            calibration = Calibration.load(f"{folder}/opencv")
        with self.assertRaisesRegex(RigcalError, "camera brown: this file has no clocks"):
            calibration.rig_time("brown", 0)
