# SPDX-License-Identifier: Apache-2.0
"""Points in 3-D with their covariance, against `TriangulateRows` of the programs."""

import json
import unittest

import numpy as np

import rig_cases
from rigcal import Calibration, RigcalError

COUNT = 120


def noisy_views(calibration, random, odd_every=0, lost=0.0):
    """Pixels by camera of points around (0, 0, 4), with 0.3 px of noise."""
    points = random.uniform(-0.6, 0.6, (COUNT, 3)) + [0, 0, 4]
    views = {}
    for i, name in enumerate(calibration.cameras):
        pixels = calibration.project(name, points) + random.normal(0, 0.3, (COUNT, 2))
        if odd_every:
            pixels[i::odd_every] += random.uniform(20, 60, pixels[i::odd_every].shape)
        pixels[random.random(COUNT) < lost] = np.nan
        views[name] = pixels
    return points, views


def as_json(views):
    return {name: [None if np.isnan(row).any() else list(row) for row in pixels]
            for name, pixels in views.items()}


class AgainstReference(unittest.TestCase):
    def compare(self, rig, views, least, **options):
        calibration = Calibration.from_json(json.dumps(rig))
        theirs = rig_cases.reference(
            rig, views=as_json(views),
            **{key: options.get(key, default) for key, default in
               [("sigma_px", 0), ("max_sigmas", 5), ("diameter_m", 0)]})["points"]
        ours = calibration.triangulate(views, **options)
        made = np.flatnonzero(np.isfinite(ours.position_m).all(-1))
        self.assertEqual(sorted(int(i) for i in theirs), list(made))
        self.assertGreater(len(made), least)
        for i in made:
            point = theirs[str(i)]
            used = {name for name, is_used in zip(ours.cameras, ours.used[i]) if is_used}
            self.assertEqual(used, set(point["cameras"]), i)
            np.testing.assert_allclose(ours.position_m[i], point["position_m"], atol=1e-9)
            np.testing.assert_allclose(ours.error_px[i], point["error_px"], atol=1e-9)
            for name in ("noise_m2", "covariance_m2"):
                theirs_m2 = np.reshape(point[name], (3, 3))
                np.testing.assert_allclose(
                    getattr(ours, name)[i], theirs_m2, atol=1e-9 * np.abs(theirs_m2).max())
        bad = np.setdiff1d(np.arange(len(ours)), made)
        self.assertTrue(np.isnan(ours.covariance_m2[bad]).all())
        self.assertTrue((ours.camera_count[bad] == 0).all())
        return ours

    def setUp(self):
        self.rig = rig_cases.rig()
        self.calibration = Calibration.from_json(json.dumps(self.rig))
        self.random = np.random.default_rng(11)

    def test_points_and_covariances(self):
        _, views = noisy_views(self.calibration, self.random)
        made = self.compare(self.rig, views, 100)
        self.assertTrue(made.has_calibration_covariance)

    def test_given_sigma(self):
        _, views = noisy_views(self.calibration, self.random)
        made = self.compare(self.rig, views, 100, sigma_px=0.7)
        by_camera = {name: 0.7 for name in views}
        again = self.calibration.triangulate(views, sigma_px=by_camera)
        np.testing.assert_allclose(again.covariance_m2, made.covariance_m2, rtol=1e-12)

    def test_cameras_that_do_not_see_all(self):
        _, views = noisy_views(self.calibration, self.random, lost=0.6)
        made = self.compare(self.rig, views, 60)
        self.assertLess(made.camera_count.min(), 2, "the case has no point that one camera sees")

    def test_centres_that_do_not_agree_are_left_out(self):
        _, views = noisy_views(self.calibration, self.random, odd_every=4, lost=0.5)
        made = self.compare(self.rig, views, 50)
        seen = sum(np.isfinite(pixels).all(1) for pixels in views.values())
        has_point = made.camera_count > 0
        self.assertTrue((made.camera_count[has_point] < seen[has_point]).any())
        self.assertTrue(((seen >= 2) & ~has_point).any(), "no point is refused")

    def test_spheres(self):
        _, views = noisy_views(self.calibration, self.random, lost=0.2)
        with_spheres = self.compare(self.rig, views, 60, diameter_m=0.04)
        without = self.calibration.triangulate(views)
        self.assertGreater(np.nanmax(np.abs(with_spheres.position_m - without.position_m)), 1e-6)

    def test_without_covariance(self):
        rig = rig_cases.rig(with_covariance=False)
        _, views = noisy_views(self.calibration, self.random)
        self.assertFalse(self.compare(rig, views, 100).has_calibration_covariance)

    def test_two_cameras_in_any_order(self):
        _, views = noisy_views(self.calibration, self.random)
        made = self.compare(self.rig, {name: views[name] for name in ("rational", "brown")}, 100)
        self.assertEqual(made.cameras, ("brown", "rational"))

    def test_blocks_are_those_of_the_whole(self):
        _, views = noisy_views(self.calibration, self.random, odd_every=9, lost=0.3)
        many = {name: np.tile(pixels, (250, 1)) for name, pixels in views.items()}
        once, often = self.calibration.triangulate(views), self.calibration.triangulate(many)
        self.assertEqual(len(often), 250 * COUNT)
        np.testing.assert_allclose(often.position_m[-COUNT:], once.position_m, atol=1e-12)
        np.testing.assert_array_equal(often.used[-COUNT:], once.used)


class StatedErrors(unittest.TestCase):
    def test_are_right(self):
        calibration = Calibration.from_json(json.dumps(rig_cases.rig(with_covariance=False)))
        random = np.random.default_rng(5)
        points, views = noisy_views(calibration, random)
        made = calibration.triangulate(views, sigma_px=0.3)
        good = np.isfinite(made.position_m).all(1)
        error = (made.position_m - points)[good]
        solved = np.linalg.solve(made.noise_m2[good], error[..., None])[..., 0]
        squares = np.einsum("ni,ni->n", error, solved)
        # Chi-squared of 3 degrees of freedom each; their mean of 120 has one sigma of 0.22.
        self.assertAlmostEqual(squares.mean(), 3, delta=0.9)
        np.testing.assert_allclose(made.sigma_m[good] ** 2,
                                   np.diagonal(made.covariance_m2[good], axis1=1, axis2=2))


class BadInput(unittest.TestCase):
    def setUp(self):
        self.calibration = Calibration.from_json(json.dumps(rig_cases.rig()))

    def test_is_named(self):
        two = np.zeros((4, 2))
        for views, message in [
            ({"brown": two}, "from two cameras at least, and there are pixels of brown"),
            ({}, "pixels of none"),
            ({"brown": two, "left": two}, "no camera left; it has brown"),
            ({"brown": two, "pole": np.zeros((5, 2))}, "pixels of pole must be .N, 2. with the N"),
            ({"brown": two, "pole": np.zeros((2, 5))}, "pixels of pole must be .N, 2., got .2, 5"),
        ]:
            with self.assertRaisesRegex(ValueError, message):
                self.calibration.triangulate(views)
        with self.assertRaisesRegex(ValueError, "sigma_px must be positive, got -1"):
            self.calibration.triangulate({"brown": two, "pole": two}, sigma_px=-1)
        with self.assertRaisesRegex(ValueError, "no camera left; it has brown"):
            self.calibration.triangulate({"brown": two, "pole": two}, sigma_px={"left": 1})
        with self.assertRaisesRegex(ValueError, "max_sigmas"):
            self.calibration.triangulate({"brown": two, "pole": two}, max_sigmas=0)

    def test_no_points_are_no_error(self):
        none = np.zeros((0, 2))
        made = self.calibration.triangulate({"brown": none, "pole": none})
        self.assertEqual(made.position_m.shape, (0, 3))
        self.assertEqual(made.used.shape, (0, 2))

    def test_parallel_rays_have_no_point(self):
        middle = self.calibration.camera("pinhole").lens.matrix[:2, 2]
        rig = rig_cases.rig()
        pinhole = next(camera for camera in rig["cameras"] if camera["camera"] == "pinhole")
        rig["cameras"] = [pinhole, {**pinhole, "camera": "twin"}]
        twins = Calibration.from_json(json.dumps(rig))
        made = twins.triangulate({"pinhole": [middle], "twin": [middle]})
        self.assertTrue(np.isnan(made.position_m).all())

    def test_without_scale_there_are_no_points(self):
        rig = {**rig_cases.rig(), "scale_known": False}
        calibration = Calibration.from_json(json.dumps(rig))
        with self.assertRaisesRegex(RigcalError, "the scale of the calibration is not known"):
            calibration.triangulate({"brown": np.zeros((1, 2)), "pole": np.zeros((1, 2))})
