# SPDX-License-Identifier: Apache-2.0
"""Projection, its inverse and its derivatives, against rigcal's own code."""

import json
import unittest

import numpy as np

import rig_cases
from rigcal import Calibration, Lens, RigcalError


def setUpModule():
    global CALIBRATION, POINTS, PIXELS, REFERENCE
    random = np.random.default_rng(3)
    near = random.uniform(-1.5, 1.5, (300, 3)) + [0, 0, 4]
    anywhere = random.uniform(-12, 12, (300, 3))
    POINTS = np.concatenate([near, anywhere])
    PIXELS = np.concatenate(
        [random.uniform(0, 1280, (300, 2)), random.uniform(-4e3, 5e3, (300, 2))])
    rig = rig_cases.rig()
    CALIBRATION = Calibration.from_json(json.dumps(rig))
    # One point on the axis of each camera, and its centre.
    for name in CALIBRATION.cameras:
        camera = CALIBRATION.camera(name)
        POINTS = np.concatenate([POINTS, [camera.position_m + 2 * camera.cam_from_rig[2, :3]]])
    PIXELS = np.concatenate([PIXELS, [CALIBRATION.camera("fisheye").lens.matrix[:2, 2]]])
    REFERENCE = rig_cases.reference(rig, points_rig=POINTS.tolist(), pixels=PIXELS.tolist())


class LensAgainstReference(unittest.TestCase):
    def expect_equal(self, ours, theirs, least_numbers, what):
        np.testing.assert_array_equal(np.isnan(ours), np.isnan(theirs), what)
        self.assertGreater(np.isfinite(ours).all(-1).sum(), least_numbers, what)
        # Of what is far outside of the image only the share of it can be compared.
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-9, err_msg=what)

    def test_projects_as_the_programs_do(self):
        for name in rig_cases.LENSES:
            theirs = rig_cases.rows_of(REFERENCE["cameras"][name]["pixels"], 2)
            self.expect_equal(CALIBRATION.project(name, POINTS), theirs, 300, name)
            self.assertGreater(np.isnan(theirs).any(-1).sum(), 50, "none is behind the camera")

    def test_undistorts_as_the_programs_do(self):
        for name in rig_cases.LENSES:
            theirs = rig_cases.rows_of(REFERENCE["cameras"][name]["undistorted"], 2)
            self.expect_equal(CALIBRATION.undistort(name, PIXELS), theirs, 60, name)

    def test_lenses_with_an_edge_have_no_inverse_beyond_it(self):
        for name in ("strong", "folding"):
            straight = CALIBRATION.undistort(name, PIXELS)
            self.assertGreater(np.isnan(straight).any(-1).sum(), 50, name)

    def test_undistorting_undoes_the_projection(self):
        for name in rig_cases.LENSES:
            camera = CALIBRATION.camera(name)
            straight = camera.lens.undistort(PIXELS[:300])
            again = camera.lens.project(np.concatenate([straight, np.ones((300, 1))], axis=1))
            seen = np.isfinite(straight).all(-1)
            np.testing.assert_allclose(again[seen], PIXELS[:300][seen], atol=2e-6, err_msg=name)

    def test_a_ray_goes_through_the_point_that_was_projected(self):
        for name in rig_cases.LENSES:
            pixels = CALIBRATION.project(name, POINTS[:300])
            origin, directions = CALIBRATION.rays(name, pixels)
            along = POINTS[:300] - origin
            along /= np.linalg.norm(along, axis=-1, keepdims=True)
            good = np.isfinite(directions).all(-1)
            self.assertGreater(good.sum(), 200, name)
            np.testing.assert_allclose(directions[good], along[good], atol=1e-8, err_msg=name)

    def test_derivatives_are_those_of_the_pixels(self):
        step = 1e-6
        for name in rig_cases.LENSES:
            camera = CALIBRATION.camera(name)
            lens = camera.lens
            points = camera.to_camera(POINTS[:100])
            made = lens.project_with_derivatives(points)
            np.testing.assert_array_equal(made.pixels, lens.project(points))
            for axis in range(3):
                shift = step * np.eye(3)[axis]
                slope = (lens.project(points + shift) - lens.project(points - shift)) / (2 * step)
                np.testing.assert_allclose(made.d_point[:, :, axis], slope, rtol=1e-5, atol=1e-3)
            values = [lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px, *lens.coefficients]
            for i in range(len(values)):
                moved = []
                for sign in (1, -1):
                    changed = list(values)
                    changed[i] += sign * step
                    moved.append(Lens(lens.model, *changed[:4], tuple(changed[4:])).project(points))
                slope = (moved[0] - moved[1]) / (2 * step)
                np.testing.assert_allclose(made.d_intrinsics[:, :, i], slope, rtol=1e-5, atol=1e-2)


class Shapes(unittest.TestCase):
    def test_any_number_of_axes(self):
        name = "brown"
        flat = CALIBRATION.project(name, POINTS[:12])
        np.testing.assert_array_equal(
            CALIBRATION.project(name, POINTS[:12].reshape(3, 4, 3)), flat.reshape(3, 4, 2))
        np.testing.assert_array_equal(CALIBRATION.project(name, POINTS[0]), flat[0])
        self.assertEqual(CALIBRATION.project(name, np.zeros((0, 3))).shape, (0, 2))
        self.assertEqual(CALIBRATION.undistort(name, np.zeros((0, 2))).shape, (0, 2))

    def test_wrong_shapes_name_the_axis(self):
        with self.assertRaisesRegex(ValueError, r"points_rig must be \(N, 3\), got \(3, 5\): axis"):
            CALIBRATION.project("brown", np.zeros((3, 5)))
        with self.assertRaisesRegex(ValueError, r"pixels must be \(N, 2\), got \(4,\)"):
            CALIBRATION.undistort("brown", np.zeros(4))
        with self.assertRaisesRegex(ValueError, r"pixels must be \(N, 2\), got one number"):
            CALIBRATION.rays("brown", 3.0)

    def test_an_unknown_camera_is_named_with_those_there_are(self):
        with self.assertRaisesRegex(ValueError, "no camera left; it has brown, fisheye"):
            CALIBRATION.project("left", POINTS)


class BadLenses(unittest.TestCase):
    def test_are_refused(self):
        with self.assertRaisesRegex(RigcalError, "splined is no lens model; known are plumb_bob, "):
            Lens("splined", 700, 700, 640, 512)
        with self.assertRaisesRegex(RigcalError, "5 distortion coefficients .or none., not 4"):
            Lens("plumb_bob", 700, 700, 640, 512, (0.1, 0, 0, 0))
        with self.assertRaisesRegex(RigcalError, "fy_px is 0, it must be finite and positive"):
            Lens("plumb_bob", 700, 0, 640, 512)
        with self.assertRaisesRegex(RigcalError, "must be finite"):
            Lens("plumb_bob", 700, 700, float("nan"), 512)
