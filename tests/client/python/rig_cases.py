# SPDX-License-Identifier: Apache-2.0
"""Calibrations of made-up rigs with every lens model, and what the programs make of them."""

import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

LENSES = {
    "pinhole": ("MODEL_BROWN_CONRADY", []),
    "brown": ("MODEL_BROWN_CONRADY", [-0.21, 0.2, 0.0003, -0.0007, -0.14]),
    "strong": ("MODEL_BROWN_CONRADY", [-0.45, 0.05, 0.001, 0.002, 0.0]),
    "rational": ("MODEL_RATIONAL", [0.9, 0.4, 0.0005, -0.0004, 0.02, 1.2, 0.6, 0.05]),
    # Its denominator has a pole within sight.
    "pole": ("MODEL_RATIONAL", [0.1, 0.0, 0.0, 0.0, 0.0, -0.9, 0.0, 0.0]),
    "fisheye": ("MODEL_FISHEYE", [0.02, -0.01, 0.004, -0.002]),
    "folding": ("MODEL_FISHEYE", [-0.2, 0.0, 0.0, 0.0]),
    # It rises again behind the fold, where what it shows is no inverse either.
    "rising": ("MODEL_FISHEYE", [-0.9, 0.3, 0.0, 0.0]),
}


def _towards(position: np.ndarray, goal: np.ndarray) -> tuple[list[float], np.ndarray]:
    """Quaternion (w x y z) and translation of cam_from_rig of a camera that looks at `goal`."""
    z = (goal - position) / np.linalg.norm(goal - position)
    x = np.cross([0, 1.0, 0.1], z)
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    w = np.sqrt(max(0.0, 1 + np.trace(rotation))) / 2
    if w < 1e-3:
        raise ValueError("choose another position")
    off = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                    rotation[1, 0] - rotation[0, 1]])
    quaternion = np.array([w, *(off / (4 * w))])
    quaternion /= np.linalg.norm(quaternion)
    return list(quaternion), -rotation @ position


def rig(with_covariance: bool = True) -> dict[str, Any]:
    """The JSON of a calibration whose cameras stand around (0, 0, 4), one for each lens."""
    random = np.random.default_rng(7)
    cameras, size = [], 0
    for i, (name, (model, distortion)) in enumerate(sorted(LENSES.items())):
        angle = 0.3 * (i - 3.5)
        position = np.array([4 * np.sin(angle), random.uniform(-1, 1), 4 - 4 * np.cos(angle)])
        quaternion, translation = _towards(position, np.array([0.0, 0.1, 4.0]))
        refined = i % 3 == 1
        size += (6 if i else 0) + (4 + _count(model) if refined else 0)
        cameras.append({
            "camera": name,
            "image_size_px": {"width": 1280, "height": 1024},
            "cam_from_rig": {
                "rotation": dict(zip("wxyz", quaternion)),
                "translation_m": dict(zip("xyz", translation)),
            },
            "intrinsics": {
                "model": model, "fx_px": 700 + 20 * i, "fy_px": 705 + 20 * i,
                "cx_px": 640.5 + i, "cy_px": 511.5 - i, "distortion": distortion,
            },
            "intrinsics_refined": refined,
            "clock_id": name,
            "residuals": {"inlier": {"rms_px": 0.2 + 0.05 * i}},
        })
    calibration = {
        "id": "c-000009", "rig": "rig", "version": 1, "state": "STATE_SUCCEEDED",
        "scale_known": True, "reference_camera": cameras[0]["camera"], "cameras": cameras,
        "target": {
            "given": {"kind": "KIND_WAND", "marker_positions_m": [0, 0.13, 0.39]},
            "marker_positions_m": [0, 0.13, 0.39], "scale_sigma_rel": 0.002,
        },
    }
    if with_covariance:
        root = 1e-3 * random.normal(size=(size, size)) / np.sqrt(size)
        matrix = root @ root.T
        calibration["camera_covariance"] = list(matrix[np.tril_indices(size)])
    return calibration


def _count(model: str) -> int:
    return {"MODEL_BROWN_CONRADY": 5, "MODEL_RATIONAL": 8, "MODEL_FISHEYE": 4}[model]


def write(calibration: dict[str, Any], folder: Path) -> Path:
    """As calibration.json in the folder."""
    path = folder / "calibration.json"
    path.write_text(json.dumps(calibration))
    return path


def program(name: str) -> str:
    """The path of a program of this build."""
    return str(Path(os.environ["RIGCAL_PROGRAMS"]) / name)


def reference(calibration: dict[str, Any], **request: Any) -> dict[str, Any]:
    """What rigcal's own code makes of the request; see reference_geometry.cc."""
    whole = {"points_rig": [], "pixels": [], "times_ns": [], "y_px": [], "views": {},
             "sigma_px": 0, "max_sigmas": 5, "diameter_m": 0, **request}
    with tempfile.TemporaryDirectory() as folder:
        path = write(calibration, Path(folder))
        asked = Path(folder) / "request.json"
        asked.write_text(json.dumps(whole))
        made = subprocess.run([program("rigcal-reference-geometry"), path, asked],
                              capture_output=True, text=True, check=False)
    if made.returncode != 0:
        raise RuntimeError(made.stderr)
    return json.loads(made.stdout)


def rows_of(values: list[Any], width: int) -> np.ndarray:
    """JSON rows as an array, null as NaN."""
    return np.array([[np.nan] * width if row is None else row for row in values], dtype=float)
