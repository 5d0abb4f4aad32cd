# SPDX-License-Identifier: Apache-2.0
# blender -b --factory-startup --python blender_judge.py -- FOLDER
# Runs FOLDER/rig.py and prints where Blender shows the points of FOLDER/points.txt: NAME u v, with
# the centre of the first pixel at (0, 0).
import sys

import bpy
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

folder = sys.argv[sys.argv.index("--") + 1]
exec(compile(open(folder + "/rig.py").read(), "rig.py", "exec"))
points = [line.split() for line in open(folder + "/points.txt")]
for scene in bpy.data.scenes:
    camera = scene.camera
    if camera is None or camera.get("rigcal_name") is None:
        continue
    scene.view_layers[0].update()
    width, height = scene.render.resolution_x, scene.render.resolution_y
    for name, x, y, z in points:
        if name != camera["rigcal_name"]:
            continue
        seen = world_to_camera_view(scene, camera, Vector((float(x), float(y), float(z))))
        print("SEEN", name, seen.x * width - 0.5, (1 - seen.y) * height - 0.5)
