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
from rigcal.json_fields import number_of, numbers_of, part_of, size_of
from rigcal.lens import COEFFICIENT_COUNTS, Lens
from rigcal.opencv_yaml import parse_opencv_yaml
from rigcal.triangulation import CameraCovariance

_ROTATION_TOLERANCE = 1e-6  # of the products of the rows of a rotation

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
        cameras = tuple(
            _camera_of(number, camera) for number, camera in enumerate(message["cameras"], 1)
        )
        _check_names(cameras)
        reference = str(message.get("reference_camera", ""))
        target = dict(message.get("target") or {})
        return CalibrationContent(
            id=str(message.get("id", "")),
            cameras=cameras,
            covariance=_covariance_of(message, cameras, reference),
            reference_camera=reference,
            scale_known=bool(message.get("scale_known", False)),
            scale_sigma_rel=number_of(target, "scale_sigma_rel", "target."),
            target=target,
            message=message,
        )
    except RigcalError as error:
        raise RigcalError(f"{name}: {error}") from None
    except (TypeError, ValueError, AttributeError) as error:
        raise RigcalError(f"{name} is not the JSON of a calibration: {error}") from None


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise RigcalError(f"cannot read the calibration {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RigcalError(f"{path} is not the JSON of a calibration: it is no text") from None


def _check_names(cameras: tuple[Camera, ...]) -> None:
    """Refuses two cameras of one name."""
    names = [camera.name for camera in cameras]
    for name in names:
        if names.count(name) > 1:
            raise RigcalError(f"camera {name} is there {names.count(name)} times; keep one of them")


def _camera_of(number: int, message: Any) -> Camera:
    """The camera at a place of the list; the first is number 1."""
    if not isinstance(message, dict):
        raise RigcalError(f"camera number {number} is no object")
    name = message.get("camera")
    if not isinstance(name, str) or not name:
        raise RigcalError(f"camera number {number} has no name: its field camera is missing")
    try:
        intrinsics = part_of(message, "intrinsics")
        model = intrinsics.get("model")
        if not isinstance(model, (str, int)) or model not in _MODELS:
            raise RigcalError(
                f"intrinsics.model: the lens model {model} is not known here; known are "
                + ", ".join(key for key in _MODELS if isinstance(key, str))
                + "; a newer release of rigcal may know it"
            )
        focal_and_centre = (
            number_of(intrinsics, key, "intrinsics.")
            for key in ("fx_px", "fy_px", "cx_px", "cy_px")
        )
        distortion = tuple(numbers_of(intrinsics, "distortion", "intrinsics."))
        size = part_of(message, "image_size_px")
        height = size_of(size, "height", "image_size_px.")
        inlier = message.get("residuals", {}).get("inlier", {})
        rms_px = float(inlier.get("rms_px", 0))
        return Camera(
            name=name,
            width_px=size_of(size, "width", "image_size_px."),
            height_px=height,
            lens=Lens(_MODELS[model], *focal_and_centre, distortion),
            cam_from_rig=_transform_of(part_of(message, "cam_from_rig")),
            clock=_clock_of(message, height),
            sigma_px=rms_px / math.sqrt(2) if 0 < rms_px < math.inf else Camera.sigma_px,
            intrinsics_refined=bool(message.get("intrinsics_refined", False)),
        )
    except (RigcalError, TypeError, ValueError, AttributeError) as error:
        raise RigcalError(f"camera {name}: {error}") from None


def _transform_of(message: dict[str, Any]) -> np.ndarray:
    rotation = message.get("rotation") or {}
    translation = message.get("translation_m") or {}
    quaternion = [number_of(rotation, key, "cam_from_rig.rotation.") for key in "wxyz"]
    transform = np.eye(4)
    try:
        transform[:3, :3] = rotation_of_quaternion(*quaternion)
    except RigcalError as error:
        raise RigcalError(f"cam_from_rig.rotation: {error}") from None
    transform[:3, 3] = [
        number_of(translation, key, "cam_from_rig.translation_m.") for key in "xyz"
    ]
    return transform


def _clock_of(message: dict[str, Any], height_px: int) -> CameraClock:
    course = message.get("clock_course") or []
    return CameraClock(
        offset_s=number_of(message, "time_offset_s"),
        rate_ppm=number_of(message, "time_rate_ppm"),
        epoch_s=number_of(message, "time_epoch_s"),
        course_time_ns=tuple(int(corner.get("camera_time_ns", 0)) for corner in course),
        course_offset_s=tuple(number_of(corner, "offset_s", "clock_course.") for corner in course),
        line_delay_s=number_of(message, "line_delay_s"),
        middle_row_px=0.5 * (height_px - 1.0),
    )


def _covariance_of(
    message: dict[str, Any], cameras: tuple[Camera, ...], reference: str
) -> CameraCovariance | None:
    """The lower triangle row by row as a matrix. None: there is none, or it is of other cameras."""
    packed = numbers_of(message, "camera_covariance")
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
    try:
        _check_names(cameras)
    except RigcalError as error:
        raise RigcalError(f"{files[0].parent}: {error}") from None
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
        for key, array, side in (("camera_matrix", matrix, 3), ("extrinsics", extrinsics, 4)):
            if array.shape != (side, side):
                raise RigcalError(f"{key} is {array.shape}, it must be {side} x {side}")
        _check_pose(extrinsics)
        for key in ("image_width", "image_height"):
            if key not in values:
                raise KeyError(key)
        coefficients = np.asarray(values["distortion_coefficients"], dtype=np.float64).ravel()
        return Camera(
            name=str(values["camera_name"]),
            width_px=size_of(values, "image_width"),
            height_px=size_of(values, "image_height"),
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
        name = values.get("camera_name", file.stem)
        raise RigcalError(f"{file}: camera {name}: {error}") from None


def _check_pose(extrinsics: np.ndarray) -> None:
    """Refuses what is no rigid motion, (4, 4)."""
    if not np.isfinite(extrinsics).all():
        raise RigcalError("extrinsics has numbers that are not finite")
    rotation = extrinsics[:3, :3]
    off = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if off > _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise RigcalError("extrinsics has no rotation: its upper left 3 x 3 is not orthonormal")
    if not np.array_equal(extrinsics[3], [0, 0, 0, 1]):
        raise RigcalError("extrinsics must end with the row 0, 0, 0, 1")
