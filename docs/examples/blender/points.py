# SPDX-License-Identifier: Apache-2.0
"""Adds the points of `rigcal triangulate --output points.csv` to a Blender scene.

    blender --python rig.py --python points.py -- points.csv [--up y]

Each marker becomes an object of its own, a cloud of vertices in metres, in the collection
"rigcal points". rig.py is of `rigcal calibration export ID --format blender`; where that had
`--up y`, so has this: Blender's z points up.
"""

import csv
import math
import sys

import bpy


def points_of(path):
    """Lists of (x, y, z), metres, by label, in the order of the file.

    ValueError: a column is missing, or a coordinate is no finite number; with file and line.
    """
    clouds = {}
    with open(path, newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        there = rows.fieldnames or []
        missing = [key for key in ("label", "x_m", "y_m", "z_m") if key not in there]
        if missing:
            raise ValueError(f"{path} has no column {', '.join(missing)}: "
                             "rigcal triangulate --output points.csv writes it")
        for row in rows:
            try:
                point = tuple(float(row[key]) for key in ("x_m", "y_m", "z_m"))
            except (TypeError, ValueError):
                point = (math.nan,) * 3
            if not all(map(math.isfinite, point)):
                raise ValueError(f"{path}:{rows.line_num}: x_m, y_m and z_m must be finite numbers")
            clouds.setdefault(row["label"], []).append(point)
    return clouds


def add_points(path, up=""):
    """Adds them; `up` "y": y of the rig frame becomes z of Blender, as the export turns it."""
    collection = bpy.data.collections.new("rigcal points")
    bpy.context.scene.collection.children.link(collection)
    for label, cloud in points_of(path).items():
        if up == "y":
            cloud = [(x, -z, y) for x, y, z in cloud]
        mesh = bpy.data.meshes.new(f"marker {label}")
        mesh.from_pydata(cloud, [], [])
        mesh.update()
        collection.objects.link(bpy.data.objects.new(f"marker {label}", mesh))


if __name__ == "__main__":
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    if len(given) not in (1, 3) or given[1:] not in ([], ["--up", "y"], ["--up", "z"]):
        sys.exit("usage: blender --python rig.py --python points.py -- points.csv [--up y]")
    try:
        add_points(given[0], given[2] if len(given) == 3 else "")
    except (OSError, ValueError) as error:
        sys.exit(f"points.py: {error}")
