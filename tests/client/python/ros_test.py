# SPDX-License-Identifier: Apache-2.0
"""The export of docs/ros2.md against the calibration: YAML, launch files, poses."""

import os
import re
import subprocess
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

import rig_cases
import rigcal
from rigcal.camera import rotation_of_quaternion

try:
    import yaml
except ModuleNotFoundError:
    yaml = None

PAGE = Path(os.environ["RIGCAL_SOURCE_DIR"]) / "docs/ros2.md"


class Ros(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        file = rig_cases.write(rig_cases.rig(), Path(folder.name))
        cls.rig = rigcal.Calibration.load(file)
        cls.ros = Path(folder.name) / "ros"
        subprocess.run([rig_cases.program("rigcal"), "calibration", "import", file, "--format",
                        "ros", "--output", cls.ros], check=True, capture_output=True)

    def check_pose(self, child, numbers):
        """x y z qx qy qz qw of a camera's optical frame."""
        x, y, z, qx, qy, qz, qw = map(float, numbers)
        self.assertAlmostEqual(np.linalg.norm([qx, qy, qz, qw]), 1, delta=1e-12)
        name = child.removesuffix("_optical_frame")
        self.assertNotEqual(name, child)
        np.testing.assert_allclose([x, y, z], self.rig.position(name), rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            rotation_of_quaternion(qw, qx, qy, qz), self.rig.rotation(name), rtol=0, atol=1e-9)
        return name

    def test_ros2_launch_file(self):
        root = ElementTree.parse(self.ros / "static_transforms.ros2.launch.xml").getroot()
        self.assertEqual(root.tag, "launch")
        self.assertEqual(root.find("arg").attrib, {"name": "rig_frame", "default": "rig"})
        named = []
        for node in root.findall("node"):
            self.assertEqual((node.get("pkg"), node.get("exec")),
                             ("tf2_ros", "static_transform_publisher"))
            given = node.get("args").split()
            given = dict(zip(given[::2], given[1::2]))
            self.assertEqual((given.pop("--frame-id")), "$(var")  # "$(var rig_frame)", a word more
            self.assertIn("--frame-id $(var rig_frame) --child-frame-id ", node.get("args"))
            numbers = [given[f"--{key}"] for key in ("x", "y", "z", "qx", "qy", "qz", "qw")]
            named.append(self.check_pose(node.get("args").split()[-1], numbers))
        self.assertEqual(sorted(named), sorted(self.rig.cameras))

    def test_ros1_launch_file(self):
        root = ElementTree.parse(self.ros / "static_transforms.ros1.launch").getroot()
        named = [self.check_pose(words[-1], words[:7])
                 for words in (node.get("args").split() for node in root.findall("node"))]
        self.assertEqual(sorted(named), sorted(self.rig.cameras))

    @unittest.skipUnless(yaml, "python3-yaml is not installed")
    def test_camera_info(self):
        for name in self.rig.cameras:
            info = yaml.safe_load((self.ros / f"{name}.camera_info.yaml").read_text())
            camera = self.rig.camera(name)
            self.assertEqual((info["camera_name"], info["distortion_model"]),
                             (name, camera.lens.model))
            self.assertEqual((info["image_width"], info["image_height"]), (1280, 1024))
            values = {key: np.reshape(info[key]["data"], (info[key]["rows"], info[key]["cols"]))
                      for key in info if isinstance(info[key], dict)}
            np.testing.assert_allclose(values["camera_matrix"], camera.lens.matrix, atol=1e-9)
            np.testing.assert_allclose(
                values["distortion_coefficients"][0], camera.lens.coefficients, atol=1e-12)
            np.testing.assert_array_equal(values["rectification_matrix"], np.eye(3))
            np.testing.assert_allclose(
                values["projection_matrix"], np.c_[camera.lens.matrix, np.zeros(3)], atol=1e-9)

    def test_the_page_names_what_is_written(self):
        text = PAGE.read_text()
        for name in re.findall(r"static_transforms[.\w]+[a-z]", text):
            self.assertTrue((self.ros / name).exists(), name)
        for model in re.findall(r"\| `(\w+)` \| k1", text):
            self.assertIn(model, [self.rig.camera(name).lens.model for name in self.rig.cameras])
        # The rotation from camera_link (x forward, y left, z up) to its optical frame.
        found = re.search(r"rotation (-?[\d.]+), (-?[\d.]+), (-?[\d.]+), (-?[\d.]+) \(x y z w\)",
                          text)
        x, y, z, w = map(float, found.groups())
        np.testing.assert_allclose(
            rotation_of_quaternion(w, x, y, z), [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-12)
