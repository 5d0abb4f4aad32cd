# SPDX-License-Identifier: Apache-2.0
"""A calibration, without a server."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigcal.array_shapes import as_nanoseconds, as_rows
from rigcal.calibration_file import CalibrationContent, parse_calibration, read_calibration
from rigcal.camera import Camera
from rigcal.clock import CameraClock
from rigcal.errors import RigcalError
from rigcal.triangulation import CameraCovariance, TriangulatedPoints, triangulate_views

Array = NDArray[np.float64]


class Calibration:
    """The cameras of a calibrated rig: projection, rays, triangulation, clocks.

    Lengths are metres, pixels have the centre of the first pixel at (0, 0), and the rig frame is
    that of the calibration; see `reference_camera`. Where a camera is named that the calibration
    does not have, ValueError names those that it has.
    """

    def __init__(self, content: CalibrationContent):
        self._content = content
        self._cameras = {camera.name: camera for camera in content.cameras}

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "Calibration":
        """Reads an export of rigcal.

        Args:
            path: A calibration.json (`rigcal calibration export ID --format json`), the folder
                that holds it, or a folder of the format `opencv`, which has neither clocks nor
                covariances.

        Raises:
            RigcalError: It cannot be read, is something else, or the calibration has no result.
        """
        return cls(read_calibration(Path(path)))

    @classmethod
    def from_json(cls, text: str, name: str = "the calibration") -> "Calibration":
        """Of the text of a calibration.json; `name` begins messages."""
        return cls(parse_calibration(name, text))

    def __repr__(self) -> str:
        return f"<rigcal.Calibration {self.id or '(no id)'}: {', '.join(self.cameras)}>"

    @property
    def id(self) -> str:
        """ "c-000001"; empty where the file has none."""
        return self._content.id

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras, in the order of the calibration."""
        return tuple(self._cameras)

    @property
    def reference_camera(self) -> str:
        """The camera whose frame is the rig frame. Empty: the frame is another one."""
        return self._content.reference_camera

    @property
    def scale_known(self) -> bool:
        """False: lengths are in units of an unknown scale, and no metres."""
        return self._content.scale_known

    @property
    def has_covariance(self) -> bool:
        """The file has the joint covariance of the cameras."""
        return self._content.covariance is not None

    @property
    def grade(self) -> str:
        """ "good", "usable" or "bad"; "" where the file has none."""
        grade = str(self.message.get("quality", {}).get("grade", ""))
        return grade.removeprefix("GRADE_").lower().replace("unspecified", "")

    @property
    def point_error_m(self) -> float:
        """The error of a point by the calibration alone, after the best alignment and at the right
        scale: this or less in 95 % of the waved places, metres. NaN: not known."""
        return self._headline_error_m("point_error_m")

    @property
    def point_error_bound_m(self) -> float:
        """What `point_error_m` is below with a probability of 95 %, metres. NaN: not known, as in
        files of older releases."""
        return self._headline_error_m("point_error_bound_m")

    def _headline_error_m(self, name: str) -> float:
        error = float(self.message.get("headline", {}).get(name, 0))
        return error if error > 0 else float("nan")

    @property
    def message(self) -> dict[str, Any]:
        """Everything that the JSON has, by the names of rigcal.v1.Calibration."""
        return self._content.message

    def camera(self, name: str) -> Camera:
        """The camera of that name, with its lens, size and clock."""
        if name not in self._cameras:
            raise ValueError(
                f"the calibration has no camera {name}; it has {', '.join(self._cameras)}"
            )
        return self._cameras[name]

    def position(self, camera: str) -> Array:
        """The camera's centre in the rig frame, (3,), metres."""
        return self.camera(camera).position_m

    def rotation(self, camera: str) -> Array:
        """rig_from_cam, (3, 3): its columns are the camera's x (right), y (down) and z (forward)
        in the rig frame. The transpose is cam_from_rig, the R of OpenCV."""
        return self.camera(camera).rotation_cam_from_rig.T

    def project(self, camera: str, points_rig: ArrayLike) -> Array:
        """Pixels of points.

        Args:
            camera: Its name.
            points_rig: (N, 3), metres.

        Returns:
            (N, 2). NaN for a point that the lens model cannot see: behind the camera, at or beyond
            a pole of the rational model, not finite. A point outside of the image gets its pixel.

        Raises:
            ValueError: The last axis of `points_rig` is not 3 long.
        """
        points = as_rows("points_rig", points_rig, 3)
        seen_by = self.camera(camera)
        in_cam = seen_by.to_camera(points.reshape(-1, 3))
        return seen_by.lens.project(in_cam).reshape(*points.shape[:-1], 2)

    def undistort(self, camera: str, pixels: ArrayLike) -> Array:
        """Normalised image coordinates, as of a pinhole of focal length 1.

        Args:
            camera: Its name.
            pixels: (N, 2).

        Returns:
            (N, 2), x/z and y/z in the camera's frame. NaN outside of the part of the image in
            which the lens has an inverse.

        Raises:
            ValueError: The last axis of `pixels` is not 2 long.
        """
        return self.camera(camera).lens.undistort(pixels)

    def rays(self, camera: str, pixels: ArrayLike) -> tuple[Array, Array]:
        """The rays that pixels look along.

        Args:
            camera: Its name.
            pixels: (N, 2).

        Returns:
            The camera's centre, (3,), metres, and unit vectors, (N, 3), both in the rig frame. NaN
            as `undistort`.

        Raises:
            ValueError: The last axis of `pixels` is not 2 long.
        """
        seen_by = self.camera(camera)
        return seen_by.position_m, seen_by.rays(pixels)

    def triangulate(
        self,
        pixels: Mapping[str, ArrayLike],
        *,
        sigma_px: float | Mapping[str, float] | None = None,
        max_sigmas: float = 5.0,
        diameter_m: float = 0.0,
    ) -> TriangulatedPoints:
        """Points in 3-D, as `rigcal triangulate` makes them of rows of one moment.

        The point is the least-squares fit in pixels, with the lens applied. A centre that does not
        agree with those of two other cameras or more is left out; where two cameras do not agree
        there is no point. The clocks are not looked at: all pixels of a point must be of one
        moment.

        Args:
            pixels: By camera (N, 2); row i of each camera is of the same point. NaN: not seen.
            sigma_px: One sigma of each coordinate of a centre, for all cameras or by camera. None:
                what the inliers of the calibration scatter, camera by camera.
            max_sigmas: A centre further than this from the point of all its views is left out.
            diameter_m: Of the spheres whose image centres the pixels are; 0: the pixels are of
                the points themselves.

        Raises:
            ValueError: Shapes, fewer than two cameras, a sigma that is not positive.
            RigcalError: The scale of the calibration is not known.
        """
        if not self.scale_known:
            raise RigcalError(
                "the scale of the calibration is not known: its points have no place in metres; "
                "calibrate with a wand, a scale bar or a known distance"
            )
        for name in pixels:
            self.camera(name)
        order = [name for name in self._cameras if name in pixels]
        if len(order) < 2:
            raise ValueError(
                "points are triangulated from two cameras at least, and there are pixels of "
                + (order[0] if order else "none")
            )
        views = [as_rows(f"pixels of {name}", pixels[name], 2) for name in order]
        for name, view in zip(order, views):
            if view.ndim != 2 or len(view) != len(views[0]):
                raise ValueError(
                    f"pixels of {name} must be (N, 2) with the N of all cameras, got {view.shape} "
                    f"where {order[0]} has {views[0].shape}"
                )
        if not max_sigmas > 0 or not diameter_m >= 0:
            raise ValueError("max_sigmas must be positive, and diameter_m 0 or more")
        cameras = [self._cameras[name] for name in order]
        return triangulate_views(
            cameras,
            np.stack(views),
            self._sigmas(cameras, sigma_px),
            covariance=self._covariance_of(cameras),
            scale_sigma_rel=self._content.scale_sigma_rel,
            max_sigmas=max_sigmas,
            diameter_m=diameter_m,
        )

    def rig_time(
        self, camera: str, camera_time_ns: ArrayLike, y_px: ArrayLike | None = None
    ) -> NDArray[np.int64]:
        """Rig time of moments of a camera's clock: offset, rate and course.

        Args:
            camera: Its name.
            camera_time_ns: Integer nanoseconds, any shape.
            y_px: Of a rolling shutter: the image row of each, pixels. None: the middle one.

        Returns:
            Integer nanoseconds of that shape.

        Raises:
            TypeError: The times are no integers.
            RigcalError: The file has no clocks.
        """
        times, rows = self._times_and_rows("camera_time_ns", camera_time_ns, y_px)
        return self._clock(camera).rig_time_ns(times, rows)

    def camera_time(
        self, camera: str, rig_time_ns: ArrayLike, y_px: ArrayLike | None = None
    ) -> NDArray[np.int64]:
        """The inverse of `rig_time`: what the camera's clock shows at rig times.

        Where the clock jumps, the first moment of it that is not before the rig time.
        """
        times, rows = self._times_and_rows("rig_time_ns", rig_time_ns, y_px)
        return self._clock(camera).camera_time_ns(times, rows)

    @staticmethod
    def _times_and_rows(
        name: str, times_ns: ArrayLike, y_px: ArrayLike | None
    ) -> tuple[NDArray[np.int64], Array | None]:
        times = as_nanoseconds(name, times_ns)
        if y_px is None:
            return times, None
        rows = np.asarray(y_px, dtype=np.float64)
        if rows.shape not in ((), times.shape):
            raise ValueError(f"y_px must be one number or {times.shape}, got {rows.shape}")
        return times, rows

    def _clock(self, camera: str) -> CameraClock:
        clock = self.camera(camera).clock
        if clock is None:
            raise RigcalError(
                f"camera {camera}: this file has no clocks; "
                "rigcal calibration export ID --format json has them"
            )
        return clock

    def _sigmas(
        self, cameras: list[Camera], sigma_px: float | Mapping[str, float] | None
    ) -> Array:
        if sigma_px is None:
            return np.array([camera.sigma_px for camera in cameras])
        if isinstance(sigma_px, Mapping):
            for name in sigma_px:
                self.camera(name)
            values = [sigma_px.get(camera.name, camera.sigma_px) for camera in cameras]
        else:
            values = [sigma_px] * len(cameras)
        sigmas = np.array(values, dtype=np.float64)
        if not (np.isfinite(sigmas) & (sigmas > 0)).all():
            raise ValueError(f"sigma_px must be positive, got {sigma_px}")
        return sigmas

    def _covariance_of(self, cameras: list[Camera]) -> CameraCovariance | None:
        """The joint covariance with its rows by these cameras."""
        whole = self._content.covariance
        if whole is None:
            return None
        at = [self.cameras.index(camera.name) for camera in cameras]
        return CameraCovariance(
            whole.matrix,
            tuple(whole.pose_row[i] for i in at),
            tuple(whole.intrinsics_row[i] for i in at),
        )
