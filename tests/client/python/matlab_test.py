# SPDX-License-Identifier: Apache-2.0
"""docs/examples/matlab in GNU Octave against rigcal's own code."""

import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np

import rig_cases

FUNCTIONS = Path(os.environ["RIGCAL_SOURCE_DIR"]) / "docs/examples/matlab"
LENSES = ("brown", "fisheye", "rational")
SIGMA_PX = 0.3


@unittest.skipUnless(shutil.which("octave-cli"), "octave-cli is not installed: apt install octave")
class Octave(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.rig = rig_cases.rig(with_covariance=False)
        self.rig["cameras"] = [c for c in self.rig["cameras"] if c["camera"] in LENSES]

    def octave(self, code):
        rig_cases.write(self.rig, self.folder)
        return subprocess.run(
            ["octave-cli", "--no-init-file", "--quiet", "--path", FUNCTIONS, "--eval", code],
            capture_output=True, text=True, check=False, cwd=self.folder)

    def values(self, code):
        done = self.octave(f"rig = rigcal_rig('calibration.json'); values = {code}; "
                           "save('-ascii', '-double', 'out.txt', 'values');")
        self.assertEqual(done.returncode, 0, done.stderr)
        return np.loadtxt(self.folder / "out.txt", ndmin=2)

    def test_projects_as_rigcal(self):
        points = np.random.default_rng(3).uniform(-0.8, 0.8, (40, 3)) + [0, 0, 4]
        points[0] = [0, 0, -50]
        np.savetxt(self.folder / "points.txt", points, fmt="%.17g")
        theirs = rig_cases.reference(self.rig, points_rig=points.tolist())["cameras"]
        for i, name in enumerate(LENSES, 1):
            seen = rig_cases.rows_of(theirs[name]["pixels"], 2)
            self.assertGreater(np.isfinite(seen).all(-1).sum(), 30)
            self.assertTrue(np.isnan(seen[0]).all())
            ours = self.values(f"rigcal_project(rig({i}), load('points.txt'))")
            np.testing.assert_allclose(ours, seen, rtol=0, atol=1e-9)

    def test_triangulates_as_rigcal(self):
        random = np.random.default_rng(4)
        points = random.uniform(-0.5, 0.5, (20, 3)) + [0, 0, 4]
        seen = rig_cases.reference(self.rig, points_rig=points.tolist())["cameras"]
        views = {name: rig_cases.rows_of(seen[name]["pixels"], 2) for name in LENSES}
        for i, view in enumerate(views.values()):
            view += random.normal(0, SIGMA_PX, view.shape)
            view[3 + i] = np.nan
        views["brown"][9] = views["fisheye"][9] = np.nan  # one camera sees it
        np.savetxt(self.folder / "views.txt", np.hstack([views[name] for name in LENSES]),
                   fmt="%.17g")
        lists = {name: [None if np.isnan(row).any() else row.tolist() for row in view]
                 for name, view in views.items()}
        made = rig_cases.reference(
            self.rig, views=lists, sigma_px=SIGMA_PX, max_sigmas=1000)["points"]
        self.assertEqual(sorted(map(int, made)), [n for n in range(20) if n != 9])
        ours = self.values("rigcal_triangulate(rig, reshape(load('views.txt'), [], 2, 3), "
                           f"{SIGMA_PX} * ones(1, 3))")
        self.assertTrue(np.isnan(ours[9]).all())
        for number, point in made.items():
            np.testing.assert_allclose(ours[int(number)], point["position_m"], rtol=0, atol=1e-9)
            self.assertLess(np.linalg.norm(ours[int(number)] - points[int(number)]), 0.02)

    def test_what_is_bad_is_named(self):
        def refused(message, code="rigcal_rig('calibration.json');"):
            done = self.octave(code)
            self.assertNotEqual(done.returncode, 0)
            self.assertRegex(done.stderr, message)

        refused("cannot read nowhere.json", "rigcal_rig('nowhere.json');")
        refused(r"points must be N x 3, not 3 x 2",
                "rigcal_project(rigcal_rig('calibration.json')(1), zeros(3, 2));")
        intrinsics = self.rig["cameras"][0]["intrinsics"]
        intrinsics["distortion"] = [0.1, 0.2]
        refused("camera brown: MODEL_BROWN_CONRADY has 5 coefficients, not 2")
        intrinsics["model"] = "MODEL_SPLINED"
        refused("camera brown: the lens model MODEL_SPLINED is not known here; known are MODEL_B")
