# SPDX-License-Identifier: Apache-2.0
"""Files of the exports json and opencv, good ones and bad ones."""

import copy
import json
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np

import rig_cases
from rigcal import Calibration, RigcalError


class Files(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.folder = Path(self._folder.name)
        self.rig = rig_cases.rig()

    def refused(self, text, message):
        path = self.folder / "calibration.json"
        path.write_text(text)
        with self.assertRaisesRegex(RigcalError, message):
            Calibration.load(path)

    def test_a_file_and_its_folder(self):
        path = rig_cases.write(self.rig, self.folder)
        for given in (path, str(path), self.folder):
            calibration = Calibration.load(given)
            self.assertEqual(calibration.id, "c-000009")
            self.assertEqual(calibration.cameras, tuple(sorted(rig_cases.LENSES)))
            self.assertEqual(calibration.reference_camera, "brown")
            self.assertTrue(calibration.scale_known and calibration.has_covariance)
            self.assertEqual(calibration.message["target"]["scale_sigma_rel"], 0.002)

    def test_places_and_directions(self):
        calibration = Calibration.load(rig_cases.write(self.rig, self.folder))
        for name in calibration.cameras:
            camera = calibration.camera(name)
            both = camera.rig_from_cam @ camera.cam_from_rig
            np.testing.assert_allclose(both, np.eye(4), atol=1e-12)
            np.testing.assert_array_equal(calibration.position(name), camera.rig_from_cam[:3, 3])
            np.testing.assert_array_equal(calibration.rotation(name), camera.rig_from_cam[:3, :3])
            # It looks at (0, 0.1, 4).
            ahead = np.array([0, 0.1, 4]) - calibration.position(name)
            np.testing.assert_allclose(
                calibration.rotation(name)[:, 2], ahead / np.linalg.norm(ahead), atol=1e-12)

    def test_the_opencv_export_has_the_same_cameras(self):
        path = rig_cases.write(self.rig, self.folder)
        written = self.folder / "opencv"
        subprocess.run([rig_cases.program("rigcal"), "calibration", "import", path,
                        "--output", written], check=True, capture_output=True)
        ours, theirs = Calibration.load(path), Calibration.load(written)
        self.assertEqual(sorted(theirs.cameras), sorted(ours.cameras))
        self.assertFalse(theirs.has_covariance)
        points = np.random.default_rng(1).uniform(-0.5, 0.5, (50, 3)) + [0, 0, 4]
        for name in ours.cameras:
            np.testing.assert_allclose(
                theirs.project(name, points), ours.project(name, points), atol=1e-9)
        one = Calibration.load(written / "brown.yaml")
        self.assertEqual(one.cameras, ("brown",))

    def test_a_covariance_of_other_cameras_is_none(self):
        self.rig["camera_covariance"].append(1.0)
        self.assertFalse(Calibration.load(rig_cases.write(self.rig, self.folder)).has_covariance)

    def test_what_is_no_calibration(self):
        hint = "rigcal calibration export ID --format json writes one"
        self.refused("nonsense", f"calibration.json is not the JSON of a calibration .*{hint}")
        self.refused("[" * 100000, "is not the JSON")
        self.refused("{}", "it has no list of cameras")
        self.refused('{"cameras": []}', "it has no field state")
        self.refused('{"cameras": [{}], "state": "STATE_SUCCEEDED"}', "KeyError..camera")
        self.refused('{"cameras": [3], "state": "STATE_SUCCEEDED"}', "is not the JSON")
        with self.assertRaisesRegex(RigcalError, "cannot read the calibration .*nowhere.json"):
            Calibration.load(self.folder / "nowhere.json")
        (self.folder / "calibration.json").write_bytes(b"\xff\xfe\x00")
        with self.assertRaisesRegex(RigcalError, "it is no text"):
            Calibration.load(self.folder)

    def test_a_calibration_without_result_says_why(self):
        failed = {**self.rig, "state": "STATE_FAILED", "error": "too few instants"}
        self.refused(json.dumps(failed), "c-000009 has no result: STATE_FAILED: too few instants")

    def test_an_unknown_lens_model_is_named_with_the_known_ones(self):
        self.rig["cameras"][2]["intrinsics"]["model"] = "MODEL_SPLINED"
        self.refused(json.dumps(self.rig),
                     "camera folding: the lens model MODEL_SPLINED is not known here; known are "
                     "MODEL_BROWN_CONRADY, MODEL_RATIONAL, MODEL_FISHEYE")

    def test_bad_values_name_the_camera(self):
        for change, message in [
            (lambda camera: camera["intrinsics"].update(distortion=[1, 2]),
             "camera brown: plumb_bob has 5 distortion coefficients"),
            (lambda camera: camera["intrinsics"].update(fx_px="NaN"), "camera brown: fx_px is nan"),
            (lambda camera: camera["cam_from_rig"]["rotation"].update(w=3.0),
             "camera brown: the rotation is not a unit quaternion"),
            (lambda camera: camera["cam_from_rig"].pop("rotation"), "not a unit quaternion"),
            (lambda camera: camera["cam_from_rig"]["translation_m"].update(x="Infinity"),
             "camera brown: its translation is not finite"),
        ]:
            rig = copy.deepcopy(self.rig)
            change(rig["cameras"][0])
            self.refused(json.dumps(rig), message)

    def test_bad_yaml(self):
        file = self.folder / "left.yaml"
        for text, message in [
            ("camera_name: left\n", "left.yaml is no file of OpenCV"),
            ("%YAML:1.0\n---\ncamera_name: left\n", "left.yaml has no camera_matrix"),
            ("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
             "   data: [ 1., 2. ]\n", "camera_matrix is no matrix of 3 x 3 real numbers"),
            ("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 1\n", "no matrix of OpenCV"),
        ]:
            file.write_text(text)
            with self.assertRaisesRegex(RigcalError, message):
                Calibration.load(file)
        file.unlink()
        with self.assertRaisesRegex(RigcalError, "neither a calibration.json nor a .yaml"):
            Calibration.load(self.folder)
