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
        self.refused('{"cameras": [{}], "state": "STATE_SUCCEEDED"}', "camera number 1 has no name: its field camera is missing")
        self.refused('{"cameras": [3], "state": "STATE_SUCCEEDED"}', "camera number 1 is no object")
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
                     "calibration.json: camera folding: intrinsics.model: the lens model MODEL_SPLINED is not known here; known are "
                     "MODEL_BROWN_CONRADY, MODEL_RATIONAL, MODEL_FISHEYE")

    def test_bad_values_name_the_camera(self):
        for change, message in [
            (lambda camera: camera["intrinsics"].update(distortion=[1, 2]),
             "camera brown: plumb_bob has 5 distortion coefficients"),
            (lambda camera: camera["intrinsics"].update(fx_px="NaN"), "camera brown: intrinsics.fx_px is NaN"),
            (lambda camera: camera["cam_from_rig"]["rotation"].update(w=3.0),
             "camera brown: cam_from_rig.rotation: the rotation is not a unit quaternion"),
            (lambda camera: camera["cam_from_rig"].pop("rotation"), "not a unit quaternion"),
            (lambda camera: camera["cam_from_rig"]["translation_m"].update(x="Infinity"),
             "camera brown: cam_from_rig.translation_m.x is Infinity, it must be a finite"),
            (lambda camera: camera["cam_from_rig"]["rotation"].update(w="NaN"),
             "camera brown: cam_from_rig.rotation.w is NaN"),
            (lambda camera: camera.pop("cam_from_rig"), "brown: cam_from_rig is missing"),
            (lambda camera: camera["image_size_px"].update(width=0),
             "brown: image_size_px.width is 0, it must be a whole number, 1 or more"),
            (lambda camera: camera["image_size_px"].update(height=-2), "size_px.height is -2"),
            (lambda camera: camera["image_size_px"].update(height=10.5), "size_px.height is 10.5"),
            (lambda camera: camera["intrinsics"].update(distortion=[0, 0, "NaN", 0, 0]),
             r"brown: intrinsics.distortion\[2\] is NaN"),
            (lambda camera: camera["intrinsics"].update(cx_px=True), "intrinsics.cx_px is True"),
            (lambda camera: camera.update(time_offset_s="NaN"), "brown: time_offset_s is NaN"),
        ]:
            rig = copy.deepcopy(self.rig)
            change(rig["cameras"][0])
            self.refused(json.dumps(rig), message)

    def test_a_camera_that_is_there_twice(self):
        self.rig["cameras"].append(self.rig["cameras"][0])
        self.refused(json.dumps(self.rig), "calibration.json: camera brown is there 2 times")

    def test_a_covariance_that_is_not_finite(self):
        self.rig["camera_covariance"][3] = "NaN"
        self.refused(json.dumps(self.rig), r"calibration.json: camera_covariance\[3\] is NaN")

    def test_bad_values_of_yaml_name_the_camera(self):
        path = rig_cases.write(self.rig, self.folder)
        written = self.folder / "opencv"
        subprocess.run([rig_cases.program("rigcal"), "calibration", "import", path,
                        "--output", written], check=True, capture_output=True)
        file, other = written / "brown.yaml", written / "pole.yaml"
        good = file.read_text()
        pose = good.index("data: [", good.index("extrinsics:")) + len("data: [")
        for text, message in [
            (good.replace("image_width: 1280", "image_width: 0"), "image_width is 0"),
            (good.replace("image_width: 1280\n", ""), "has no image_width"),
            (good[:pose] + " 2." + good[good.index(",", pose):], "brown: extrinsics has no rotation"),
            (good[:pose] + " .nan" + good[good.index(",", pose):], "extrinsics"),
        ]:
            self.assertNotEqual(text, good)
            file.write_text(text)
            with self.assertRaisesRegex(RigcalError, f"brown.yaml.*{message}"):
                Calibration.load(written)
        file.write_text(other.read_text())
        with self.assertRaisesRegex(RigcalError, "opencv: camera pole is there 2 times"):
            Calibration.load(written)

    def test_bad_yaml(self):
        file = self.folder / "left.yaml"
        for text, message in [
            ("camera_name: left\n", "left.yaml is no file of OpenCV"),
            ("%YAML:1.0\nextrinsics:\n  rows: 3\n  cols: 4\n", "extrinsics has no !!opencv-matrix"),
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
