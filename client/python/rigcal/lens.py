# SPDX-License-Identifier: Apache-2.0
"""Lenses: pinhole projection with distortion, and its inverse.

The centre of the first pixel is (0, 0). Frame of the camera: x right, y down, z forward.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigcal.array_shapes import as_rows
from rigcal.errors import RigcalError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Distortion models by the words of calibration files, with their number of coefficients:
#   plumb_bob            Brown-Conrady, k1 k2 p1 p2 k3
#   rational_polynomial  k1 k2 p1 p2 k3 k4 k5 k6
#   equidistant          fisheye, k1 k2 k3 k4
# Meaning and order as in OpenCV (calib3d, "projectPoints"; fisheye module).
COEFFICIENT_COUNTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}

_ROUND_TRIP = 1e-9  # normalised coordinates
_EXACT = 1e-14  # likewise: what rounding leaves
_MAX_NEWTON_STEPS = 100
_MAX_HALVINGS = 40
_MONOTONICITY_SAMPLES = 32
_MAX_THETA = 1.5707  # radians; the tangent of more is no useful direction
_ON_AXIS = 1e-16  # (distance from the axis / z)^2, below which theta / distance is 1 / z


def _halve_until_taken(
    take: Callable[[Indices, Array], NDArray[np.bool_]], active: Indices, step: Array
) -> NDArray[np.bool_]:
    """Newton's steps, each halved until `take` accepts it; False: none was accepted.

    Args:
        take: Of points and their steps; takes the good ones, and says which these are.
        active: (N,), the points.
        step: (N,) or (N, 2), their steps.
    """
    taken = np.zeros(active.size, dtype=bool)
    for _ in range(_MAX_HALVINGS):
        rest = np.flatnonzero(~taken)
        if rest.size == 0:
            break
        taken[rest] = take(active[rest], step[rest])
        step = 0.5 * step
    return taken


@dataclass
class _Distorted:
    """Normalised coordinates after distortion, all (N,), and their symmetric derivative."""

    x: Array
    y: Array
    dx_dx: Array
    dx_dy: Array
    dy_dy: Array
    pole: Array  # denominator of the rational model, 1 for Brown-Conrady
    radial: Array

    def is_monotone(self) -> NDArray[np.bool_]:
        determinant = self.dx_dx * self.dy_dy - self.dx_dy * self.dx_dy
        return (self.pole > 0) & (self.dx_dx > 0) & (determinant > 0)


@dataclass(frozen=True)
class Projection:
    """Pixels of points, and how they move.

    Attributes:
        pixels: (N, 2). NaN: the camera cannot see the point.
        d_point: (N, 2, 3), by the point in the camera's frame, pixels per metre.
        d_intrinsics: (N, 2, 4 + K), by fx fy cx cy and the K coefficients of the model.
    """

    pixels: Array
    d_point: Array
    d_intrinsics: Array


@dataclass(frozen=True)
class Lens:
    """Intrinsics of a camera.

    Attributes:
        model: A key of COEFFICIENT_COUNTS.
        fx_px, fy_px, cx_px, cy_px: Focal lengths and principal point, pixels.
        distortion: Coefficients in OpenCV's order, as many as the model has, or none.
    """

    model: str
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.model not in COEFFICIENT_COUNTS:
            raise RigcalError(
                f"{self.model} is no lens model; known are {', '.join(COEFFICIENT_COUNTS)}"
            )
        count = COEFFICIENT_COUNTS[self.model]
        if len(self.distortion) not in (0, count):
            raise RigcalError(
                f"{self.model} has {count} distortion coefficients (or none), "
                f"not {len(self.distortion)}"
            )
        for name in ("fx_px", "fy_px"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise RigcalError(
                    f"{name} is {getattr(self, name)}, it must be finite and positive"
                )
        if not np.all(np.isfinite([self.cx_px, self.cy_px, *self.distortion])):
            raise RigcalError("the principal point and the coefficients must be finite")

    @property
    def matrix(self) -> Array:
        """The camera matrix, (3, 3), pixels."""
        return np.array(
            [[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1]], dtype=np.float64
        )

    @property
    def coefficients(self) -> Array:
        """(K,), zeros where the lens has none."""
        if self.distortion:
            return np.array(self.distortion, dtype=np.float64)
        return np.zeros(COEFFICIENT_COUNTS[self.model])

    def project(self, points_cam: ArrayLike) -> Array:
        """Pixels of points in the camera's frame.

        Args:
            points_cam: (..., 3), metres.

        Returns:
            (..., 2). NaN for a point that the model cannot see: behind the camera (z <= 0), at or
            beyond a pole of the rational model, not finite. Beyond the part of the image in which
            a model is monotone a point still gets a pixel; only `undistort` tells.
        """
        points = as_rows("points_cam", points_cam, 3)
        with np.errstate(all="ignore"):
            pixels, _ = self._pixels(points.reshape(-1, 3))
        return pixels.reshape(*points.shape[:-1], 2)

    def project_with_derivatives(self, points_cam: ArrayLike) -> Projection:
        """As `project` of (N, 3), with the derivatives of the pixels."""
        points = as_rows("points_cam", points_cam, 3).reshape(-1, 3)
        with np.errstate(all="ignore"):
            pixels, bent = self._pixels(points)
            fisheye = self.model == "equidistant"
            derivatives = self._fisheye_derivatives if fisheye else self._polynomial_derivatives
            d_point, d_coefficients = derivatives(points, bent)
        focal = np.array([self.fx_px, self.fy_px])
        normalised = (pixels - [self.cx_px, self.cy_px]) / focal
        d_intrinsics = np.zeros((len(points), 2, 4 + d_coefficients.shape[2]))
        d_intrinsics[:, 0, 0], d_intrinsics[:, 1, 1] = normalised[:, 0], normalised[:, 1]
        d_intrinsics[:, 0, 2] = d_intrinsics[:, 1, 3] = 1
        d_intrinsics[:, :, 4:] = focal[:, None] * d_coefficients
        d_point = focal[:, None] * d_point
        seen = np.isfinite(pixels).all(-1) & np.isfinite(d_point).all((1, 2))
        pixels[~seen] = np.nan
        return Projection(pixels, d_point, d_intrinsics)

    def undistort(self, pixels: ArrayLike) -> Array:
        """Where pixels look: normalised image coordinates without distortion.

        Args:
            pixels: (..., 2).

        Returns:
            (..., 2), x/z and y/z in the camera's frame. NaN where the distortion has no inverse:
            outside of the part of the image in which the model is monotone, or not finite.
            Distorting the result gives the pixel back to 1e-9 in normalised coordinates.
        """
        given = as_rows("pixels", pixels, 2)
        distorted = (given.reshape(-1, 2) - [self.cx_px, self.cy_px]) / [self.fx_px, self.fy_px]
        result = np.full_like(distorted, np.nan)
        finite = np.isfinite(distorted).all(-1)
        invert = (
            self._undistort_fisheye if self.model == "equidistant" else self._undistort_polynomial
        )
        with np.errstate(all="ignore"):
            result[finite] = invert(distorted[finite])
        return result.reshape(given.shape)

    def directions(self, pixels: ArrayLike) -> Array:
        """Unit vectors along which pixels look, (..., 2) to (..., 3), in the camera's frame."""
        flat = self.undistort(pixels)
        rays = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True)

    def _pixels(self, points: Array) -> tuple[Array, _Distorted | None]:
        """(N, 2), and the distortion where the model is a polynomial."""
        z = points[:, 2]
        bent = None
        if self.model == "equidistant":
            gain = self._fisheye_gain(points)[0]
            normalised = points[:, :2] * gain[:, None]
            seen = z > 0
        else:
            bent = self._distort(points[:, 0] / z, points[:, 1] / z)
            normalised = np.stack([bent.x, bent.y], axis=-1)
            seen = (z > 0) & (bent.pole > 0)
        pixels = normalised * [self.fx_px, self.fy_px] + [self.cx_px, self.cy_px]
        pixels[~(seen & np.isfinite(points).all(-1) & np.isfinite(pixels).all(-1))] = np.nan
        return pixels, bent

    def _distort(self, x: Array, y: Array) -> _Distorted:
        """Brown-Conrady and the rational model (OpenCV, calib3d, "projectPoints")."""
        k = self.coefficients
        r2 = x * x + y * y
        radial = ((r2 * k[4] + k[1]) * r2 + k[0]) * r2 + 1
        slope = (r2 * 3 * k[4] + 2 * k[1]) * r2 + k[0]  # d radial / d r2
        pole = np.ones_like(r2)
        if self.model == "rational_polynomial":
            pole = ((r2 * k[7] + k[6]) * r2 + k[5]) * r2 + 1
            radial = radial / pole
            slope = (slope - radial * ((r2 * 3 * k[7] + 2 * k[6]) * r2 + k[5])) / pole
        p1, p2 = k[2], k[3]
        xy2 = 2 * x * y
        return _Distorted(
            x=x * radial + p1 * xy2 + p2 * (r2 + 2 * x * x),
            y=y * radial + p1 * (r2 + 2 * y * y) + p2 * xy2,
            dx_dx=radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x,
            dx_dy=xy2 * slope + 2 * (p1 * x + p2 * y),
            dy_dy=radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x,
            pole=pole,
            radial=radial,
        )

    def _polynomial_derivatives(self, points: Array, bent: _Distorted) -> tuple[Array, Array]:
        z = points[:, 2]
        x, y = points[:, 0] / z, points[:, 1] / z
        d_point = np.empty((len(points), 2, 3))
        for row, (dx, dy) in enumerate([(bent.dx_dx, bent.dx_dy), (bent.dx_dy, bent.dy_dy)]):
            d_point[:, row] = np.stack([dx / z, dy / z, (-dx * x - dy * y) / z], axis=-1)
        r2 = x * x + y * y
        along = np.stack([x, y], axis=-1) / bent.pole[:, None]
        powers = [along * (r2**n)[:, None] for n in (1, 2, 3)]
        first = np.stack([2 * x * y, r2 + 2 * y * y], axis=-1)
        second = np.stack([r2 + 2 * x * x, 2 * x * y], axis=-1)
        columns = [powers[0], powers[1], first, second, powers[2]]
        if self.model == "rational_polynomial":
            columns += [-power * bent.radial[:, None] for power in powers]
        return d_point, np.stack(columns, axis=-1)

    def _theta(self, theta: Array) -> tuple[Array, Array]:
        """The angle to the axis after distortion, and its derivative by the angle before.

        OpenCV, fisheye module; Kannala and Brandt 2006, "A generic camera model and calibration
        method for conventional, wide-angle, and fish-eye lenses".
        """
        k = self.coefficients
        t2 = theta * theta
        bent = theta * ((((t2 * k[3] + k[2]) * t2 + k[1]) * t2 + k[0]) * t2 + 1)
        slope = (((t2 * 9 * k[3] + 7 * k[2]) * t2 + 5 * k[1]) * t2 + 3 * k[0]) * t2 + 1
        return bent, slope

    def _fisheye_gain(self, points: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Normalised coordinates by x and y; distance from the axis; angle; is on the axis."""
        z = points[:, 2]
        rho2 = points[:, 0] ** 2 + points[:, 1] ** 2
        on_axis = rho2 < z * z * _ON_AXIS
        rho = np.sqrt(np.where(on_axis, 1.0, rho2))
        theta = np.where(on_axis, 0.0, np.arctan2(rho, z))
        return np.where(on_axis, 1 / z, self._theta(theta)[0] / rho), rho, theta, on_axis

    def _fisheye_derivatives(self, points: Array, _: None) -> tuple[Array, Array]:
        x, y, z = points.T
        gain, rho, theta, on_axis = self._fisheye_gain(points)
        slope = self._theta(theta)[1] / (x * x + y * y + z * z)
        bend = np.where(on_axis, 0.0, (slope * z - gain) / (rho * rho))
        d_point = np.empty((len(points), 2, 3))
        d_point[:, 0] = np.stack([gain + x * x * bend, x * y * bend, -x * slope], axis=-1)
        d_point[:, 1] = np.stack([x * y * bend, gain + y * y * bend, -y * slope], axis=-1)
        unit = np.where(on_axis[:, None], 0.0, points[:, :2] / rho[:, None])
        powers = theta[:, None] ** np.array([3, 5, 7, 9])
        return d_point, unit[:, :, None] * powers[:, None, :]

    def _undistort_polynomial(self, distorted: Array) -> Array:
        """Newton's method from the centre, held where the derivative is positive definite."""
        point = np.zeros_like(distorted)
        error = np.linalg.norm(distorted, axis=-1)
        active = np.flatnonzero(error > _EXACT)
        for _ in range(_MAX_NEWTON_STEPS):
            if active.size == 0:
                break
            bent = self._distort(*point[active].T)
            residual = distorted[active] - np.stack([bent.x, bent.y], axis=-1)
            determinant = bent.dx_dx * bent.dy_dy - bent.dx_dy * bent.dx_dy
            delta = np.stack(
                [
                    bent.dy_dy * residual[:, 0] - bent.dx_dy * residual[:, 1],
                    bent.dx_dx * residual[:, 1] - bent.dx_dy * residual[:, 0],
                ],
                axis=-1,
            )
            delta /= determinant[:, None]

            def bends_closer(at: Indices, step: Array) -> NDArray[np.bool_]:
                following = point[at] + step
                bent = self._distort(*following.T)
                left = np.linalg.norm(distorted[at] - np.stack([bent.x, bent.y], -1), axis=-1)
                good = (left < error[at]) & bent.is_monotone()
                point[at[good]] = following[good]
                error[at[good]] = left[good]
                return good

            better = _halve_until_taken(bends_closer, active, delta)
            active = active[better & (error[active] > _EXACT)]
        # With a positive definite derivative everywhere on the way from the image's centre the
        # map is one to one there.
        good = error <= _ROUND_TRIP
        for i in range(1, _MONOTONICITY_SAMPLES + 1):
            good &= self._distort(*(point * (i / _MONOTONICITY_SAMPLES)).T).is_monotone()
        point[~good] = np.nan
        return point

    def _undistort_fisheye(self, distorted: Array) -> Array:
        goal = np.linalg.norm(distorted, axis=-1)
        theta, value, slope = np.zeros_like(goal), np.zeros_like(goal), np.ones_like(goal)
        active = np.flatnonzero(value != goal)
        for _ in range(_MAX_NEWTON_STEPS):
            if active.size == 0:
                break
            delta = (goal[active] - value[active]) / slope[active]

            def turns_closer(at: Indices, step: Array) -> NDArray[np.bool_]:
                following = theta[at] + step
                bent, bent_slope = self._theta(following)
                good = (following >= 0) & (following <= _MAX_THETA) & (bent_slope > 0)
                good &= np.abs(goal[at] - bent) < np.abs(goal[at] - value[at])
                taken = at[good]
                theta[taken], value[taken] = following[good], bent[good]
                slope[taken] = bent_slope[good]
                return good

            better = _halve_until_taken(turns_closer, active, delta)
            active = active[better & (value[active] != goal[active])]
        good = np.abs(goal - value) <= _ROUND_TRIP
        for i in range(1, _MONOTONICITY_SAMPLES + 1):
            good &= self._theta(theta * (i / _MONOTONICITY_SAMPLES))[1] > 0
        scale = np.where(goal > 1e-12, np.tan(theta) / np.where(goal > 0, goal, 1.0), 1.0)
        return np.where(good[:, None], distorted * scale[:, None], np.nan)
