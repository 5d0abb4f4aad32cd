# SPDX-License-Identifier: Apache-2.0
"""Reads what `rigcal calibration export` writes: the formats json and opencv."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigcal.camera import Camera, rotation_of_quaternion
from rigcal.clock import CameraClock
from rigcal.errors import RigcalError
from rigcal.lens import COEFFICIENT_COUNTS, Lens
from rigcal.opencv_yaml import parse_opencv_yaml
from rigcal.triangulation import CameraCovariance

# rigcal.v1.Intrinsics.Model, by name and by number.
_MODELS = {
    "MODEL_BROWN_CONRADY": "plumb_bob",
    "MODEL_RATIONAL": "rational_polynomial",
    "MODEL_FISHEYE": "equidistant",
    1: "plumb_bob",
    2: "rational_polynomial",
    3: "equidistant",
}


@dataclass(frozen=True)
class CalibrationContent:
    """A calibration as its file holds it.

    Attributes:
        id: "c-000001"; "" in files of other formats.
        cameras: In the order of the file, which the rows of `covariance` follow.
        covariance: Of the cameras. None: the file has none.
        reference_camera: Its frame is the rig frame; "": another one is.
        scale_known: False: lengths are no metres.
        scale_sigma_rel: One sigma of every length, as a share of it.
        target: As the file has it; {}: none.
        message: The whole JSON.
    """

    id: str
    cameras: tuple[Camera, ...]
    covariance: CameraCovariance | None
    reference_camera: str
    scale_known: bool
    scale_sigma_rel: float
    target: dict[str, Any]
    message: dict[str, Any]


def read_calibration(path: Path) -> CalibrationContent:
    """Of a calibration.json, or a folder with one or with an OpenCV YAML for each camera.

    Raises:
        RigcalError: It cannot be read, is something else, or has no result.
    """
    if path.is_dir():
        own = path / "calibration.json"
        if own.exists():
            return read_calibration(own)
        files = sorted([*path.glob("*.yaml"), *path.glob("*.yml")])
        if not files:
            raise RigcalError(
                f"{path} has neither a calibration.json nor a .yaml for each camera; "
                f"rigcal calibration export ID --format json --output {path} writes one"
            )
        return _content_of_yaml(files)
    if path.suffix.lower() in (".yaml", ".yml"):
        return _content_of_yaml([path])
    return parse_calibration(str(path), _text_of(path))


def parse_calibration(name: str, text: str) -> CalibrationContent:
    """Of the text of a calibration.json; `name` begins messages.

    Raises:
        RigcalError: As read_calibration.
    """
    try:
        message = json.loads(text)
        if not isinstance(message, dict) or not isinstance(message.get("cameras"), list):
            raise ValueError("it has no list of cameras")
        if message.get("state") in (None, "STATE_UNSPECIFIED", 0):
            raise ValueError("it has no field state")
    except (ValueError, RecursionError) as error:
        raise RigcalError(
            f"{name} is not the JSON of a calibration ({error}); "
            "rigcal calibration export ID --format json writes one, and of another program's file "
            "rigcal calibration import FILE --format json"
        ) from None
    if message["state"] not in ("STATE_SUCCEEDED", 3):
        raise RigcalError(
            f"{name}: calibration {message.get('id', '')} has no result: {message['state']}"
            + (f": {message['error']}" if message.get("error") else "")
        )
    try:
        cameras = tuple(_camera_of(name, camera) for camera in message["cameras"])
        reference = str(message.get("reference_camera", ""))
        target = dict(message.get("target") or {})
        return CalibrationContent(
            id=str(message.get("id", "")),
            cameras=cameras,
            covariance=_covariance_of(message.get("camera_covariance", []), cameras, reference),
            reference_camera=reference,
            scale_known=bool(message.get("scale_known", False)),
            scale_sigma_rel=float(target.get("scale_sigma_rel", 0)),
            target=target,
            message=message,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RigcalError(f"{name} is not the JSON of a calibration: {error!r}") from None


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise RigcalError(f"cannot read the calibration {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RigcalError(f"{path} is not the JSON of a calibration: it is no text") from None


def _camera_of(file: str, message: dict[str, Any]) -> Camera:
    name = str(message["camera"])
    try:
        intrinsics = message["intrinsics"]
        model = intrinsics.get("model")
        if model not in _MODELS:
            raise RigcalError(
                f"the lens model {model} is not known here; known are "
                + ", ".join(key for key in _MODELS if isinstance(key, str))
                + "; a newer release of rigcal may know it"
            )
        lens = Lens(
            _MODELS[model],
            *(float(intrinsics.get(key, 0)) for key in ("fx_px", "fy_px", "cx_px", "cy_px")),
            tuple(float(value) for value in intrinsics.get("distortion", [])),
        )
        size = message["image_size_px"]
        width, height = int(size["width"]), int(size["height"])
        inlier = message.get("residuals", {}).get("inlier", {})
        rms_px = float(inlier.get("rms_px", 0))
        return Camera(
            name=name,
            width_px=width,
            height_px=height,
            lens=lens,
            cam_from_rig=_transform_of(message["cam_from_rig"]),
            clock=_clock_of(message, height),
            sigma_px=rms_px / math.sqrt(2) if rms_px > 0 else Camera.sigma_px,
            intrinsics_refined=bool(message.get("intrinsics_refined", False)),
        )
    except RigcalError as error:
        raise RigcalError(f"{file}: camera {name}: {error}") from None


def _transform_of(message: dict[str, Any]) -> np.ndarray:
    rotation = message.get("rotation") or {}
    translation = message.get("translation_m") or {}
    transform = np.eye(4)
    transform[:3, :3] = rotation_of_quaternion(*(float(rotation.get(key, 0)) for key in "wxyz"))
    transform[:3, 3] = [float(translation.get(key, 0)) for key in "xyz"]
    if not np.isfinite(transform).all():
        raise RigcalError("its translation is not finite")
    return transform


def _clock_of(message: dict[str, Any], height_px: int) -> CameraClock:
    course = message.get("clock_course", [])
    return CameraClock(
        offset_s=float(message.get("time_offset_s", 0)),
        rate_ppm=float(message.get("time_rate_ppm", 0)),
        epoch_s=float(message.get("time_epoch_s", 0)),
        course_time_ns=tuple(int(corner.get("camera_time_ns", 0)) for corner in course),
        course_offset_s=tuple(float(corner.get("offset_s", 0)) for corner in course),
        line_delay_s=float(message.get("line_delay_s", 0)),
        middle_row_px=0.5 * (height_px - 1.0),
    )


def _covariance_of(
    packed: list[float], cameras: tuple[Camera, ...], reference: str
) -> CameraCovariance | None:
    """The lower triangle row by row as a matrix. None: there is none, or it is of other cameras."""
    pose_row, intrinsics_row, size = [], [], 0
    for camera in cameras:
        has_pose = camera.name != reference
        pose_row.append(size if has_pose else -1)
        size += 6 if has_pose else 0
        intrinsics_row.append(size if camera.intrinsics_refined else -1)
        size += 4 + COEFFICIENT_COUNTS[camera.lens.model] if camera.intrinsics_refined else 0
    if size == 0 or len(packed) != size * (size + 1) // 2:
        return None
    matrix = np.zeros((size, size))
    matrix[np.tril_indices(size)] = packed
    matrix = matrix + matrix.T - np.diag(np.diag(matrix))
    return CameraCovariance(matrix, tuple(pose_row), tuple(intrinsics_row))


def _content_of_yaml(files: list[Path]) -> CalibrationContent:
    cameras = tuple(_camera_of_yaml(file) for file in files)
    return CalibrationContent(
        id="",
        cameras=cameras,
        covariance=None,
        reference_camera="",
        scale_known=True,
        scale_sigma_rel=0,
        target={},
        message={},
    )


def _camera_of_yaml(file: Path) -> Camera:
    values = parse_opencv_yaml(str(file), _text_of(file))
    try:
        matrix = np.asarray(values["camera_matrix"], dtype=np.float64)
        extrinsics = np.asarray(values["extrinsics"], dtype=np.float64)
        if matrix.shape != (3, 3) or extrinsics.shape != (4, 4):
            raise RigcalError("camera_matrix is not 3 x 3, or extrinsics is not 4 x 4")
        coefficients = np.asarray(values["distortion_coefficients"], dtype=np.float64).ravel()
        return Camera(
            name=str(values["camera_name"]),
            width_px=int(values["image_width"]),  # type: ignore[call-overload]
            height_px=int(values["image_height"]),  # type: ignore[call-overload]
            lens=Lens(
                str(values["distortion_model"]),
                *(float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2))),
                tuple(float(value) for value in coefficients),
            ),
            cam_from_rig=extrinsics,
        )
    except KeyError as error:
        raise RigcalError(
            f"{file} has no {error.args[0]}: it is not of rigcal calibration export --format opencv"
        ) from None
    except (RigcalError, ValueError, TypeError) as error:
        raise RigcalError(f"{file}: {error}") from None
