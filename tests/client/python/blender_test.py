# SPDX-License-Identifier: Apache-2.0
"""docs/examples/blender: with a stand-in for bpy, and in Blender itself where it is installed."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import types
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import rig_cases
import rigcal

SCRIPT = Path(os.environ["RIGCAL_SOURCE_DIR"]) / "docs/examples/blender/points.py"
HEADER = "time_s,label,x_m,y_m,z_m\n"


class StandIn(types.ModuleType):
    """What of bpy the script uses: names, vertices and links."""

    def __init__(self):
        super().__init__("bpy")
        self.linked = {}
        mesh = lambda name: types.SimpleNamespace(
            from_pydata=lambda points, edges, faces: self.linked.update({name: points}),
            update=lambda: None)
        collection = types.SimpleNamespace(
            objects=types.SimpleNamespace(link=lambda named: None))
        new = lambda make: types.SimpleNamespace(new=make)
        self.data = types.SimpleNamespace(
            collections=new(lambda name: collection), meshes=new(mesh),
            objects=new(lambda name, data: data))
        self.context = types.SimpleNamespace(scene=types.SimpleNamespace(
            collection=types.SimpleNamespace(
                children=types.SimpleNamespace(link=lambda linked: None))))


class Points(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.csv = self.folder / "points.csv"
        self.csv.write_text(HEADER + "0.1,a,1,2,3\n0.1,b,4,5,6\n0.2,a,7,8,9\n")

    def added(self, **options):
        stand_in = StandIn()
        with mock.patch.dict(sys.modules, {"bpy": stand_in}):
            spec = importlib.util.spec_from_file_location("points", SCRIPT)
            script = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(script)
            script.add_points(str(self.csv), **options)
        return stand_in.linked

    def test_each_marker_is_an_object(self):
        self.assertEqual(
            self.added(), {"marker a": [(1, 2, 3), (7, 8, 9)], "marker b": [(4, 5, 6)]})
        self.assertEqual(self.added(up="y")["marker b"], [(4, -6, 5)])

    def test_bad_files_are_named_with_the_line(self):
        for text, message in [
            ("time_s,label\n1,a\n", "points.csv has no column x_m, y_m, z_m: rigcal triangulate"),
            ("", "has no column label"),
            (HEADER + "0,a,1,2,3\n0,a,1,x,3\n", "points.csv:3: x_m, y_m and z_m must be finite"),
            (HEADER + "0,a,1,2,nan\n", "points.csv:2"),
            (HEADER + "0,a,1\n", "points.csv:2"),
        ]:
            self.csv.write_text(text)
            with self.assertRaisesRegex(ValueError, message):
                self.added()

    @unittest.skipUnless(shutil.which("blender"), "blender is not installed")
    def test_in_blender_points_are_seen_where_they_are(self):
        rig = rig_cases.rig()
        file = rig_cases.write(rig, self.folder)
        calibration = rigcal.Calibration.load(file)
        subprocess.run([rig_cases.program("rigcal"), "calibration", "import", file, "--format",
                        "blender", "--undistorted", "--output", self.folder / "out"],
                       check=True, capture_output=True)
        points = np.random.default_rng(5).uniform(-0.5, 0.5, (8, 3)) + [0, 0, 4]
        self.csv.write_text(HEADER + "".join(f"0,a,{x},{y},{z}\n" for x, y, z in points))
        (self.folder / "judge.py").write_text(
            "import bpy, json\n"
            "from bpy_extras.object_utils import world_to_camera_view\n"
            "cloud = bpy.data.objects['marker a']\n"
            "seen = {}\n"
            "for scene in bpy.data.scenes:\n"
            "    if scene.camera and 'rigcal_name' in scene.camera:\n"
            "        scene.view_layers[0].update()\n"
            "        seen[scene.camera['rigcal_name']] = [\n"
            "            tuple(world_to_camera_view(scene, scene.camera, vertex.co))\n"
            "            for vertex in cloud.data.vertices]\n"
            f"json.dump(seen, open({str(self.folder / 'seen.json')!r}, 'w'))\n")
        done = subprocess.run(
            ["blender", "--background", "--factory-startup", "--python", self.folder / "out/rig.py",
             "--python", SCRIPT, "--python", self.folder / "judge.py", "--", self.csv],
            capture_output=True, text=True, check=False, cwd=self.folder)
        self.assertTrue((self.folder / "seen.json").exists(), done.stdout + done.stderr)
        seen = json.loads((self.folder / "seen.json").read_text())
        self.assertEqual(sorted(seen), sorted(calibration.cameras))
        for name, view in seen.items():
            camera = calibration.camera(name)
            inside = camera.to_camera(points)
            flat = inside[:, :2] / inside[:, 2:]
            focal = np.array([camera.lens.fx_px, camera.lens.fy_px])
            pixels = flat * focal + [camera.lens.cx_px, camera.lens.cy_px]
            # From the lower left corner, as shares of the image. Blender's numbers are single.
            theirs = np.array(view)[:, :2] * [1280, 1024]
            theirs[:, 1] = 1024 - theirs[:, 1]
            np.testing.assert_allclose(theirs - 0.5, pixels, rtol=0, atol=0.01)
