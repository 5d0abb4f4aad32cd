# SPDX-License-Identifier: Apache-2.0
"""Points in 3-D from what calibrated cameras see of them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigcal.camera import Camera
from rigcal.sphere import sphere_centres

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MIN_SIN_BETWEEN_RAYS = 1e-3  # a twentieth of a degree
_FIT_STEPS = 10
_FIT_ENOUGH_M = 1e-10
_CHUNK_NUMBERS = 4_000_000  # of the largest array of a block of points


@dataclass(frozen=True)
class CameraCovariance:
    """The joint covariance of the cameras of a calibration.

    Attributes:
        matrix: (P, P), symmetric. Rows, camera by camera: rotation vector in the camera's frame
            (radians) and translation of cam_from_rig (metres), without the reference camera, then
            fx fy cx cy and the coefficients where they were refined.
        pose_row: By camera: its first row of the pose; -1: it is exact.
        intrinsics_row: By camera: its first row of the intrinsics; -1: they are exact.
    """

    matrix: Array
    pose_row: tuple[int, ...]
    intrinsics_row: tuple[int, ...]


@dataclass(frozen=True)
class TriangulatedPoints:
    """Points in the rig frame. Where N points were asked for, all arrays have N rows.

    Attributes:
        position_m: (N, 3). NaN: no point; fewer than two cameras see it, the rays are less than a
            twentieth of a degree apart, a lens has no ray, or the cameras do not agree.
        covariance_m2: (N, 3, 3): of the noise of the centres, of the errors of the calibration
            where `has_calibration_covariance`, and of its scale.
        noise_m2: (N, 3, 3): of the noise of the centres alone.
        error_px: (N,): root mean square reprojection error over the cameras used.
        used: (N, C): the cameras that each point is from, in the order of `cameras`.
        cameras: Names.
        has_calibration_covariance: False: the calibration says nothing of its own errors.
    """

    position_m: Array
    covariance_m2: Array
    noise_m2: Array
    error_px: Array
    used: Mask
    cameras: tuple[str, ...]
    has_calibration_covariance: bool

    def __len__(self) -> int:
        return len(self.position_m)

    @cached_property
    def sigma_m(self) -> Array:
        """One sigma along the axes of the rig frame, (N, 3)."""
        return np.sqrt(np.diagonal(self.covariance_m2, axis1=1, axis2=2))

    @cached_property
    def camera_count(self) -> NDArray[np.int64]:
        """How many cameras each point is from, (N,); 0: no point."""
        return self.used.sum(axis=1)


@dataclass
class _Fit:
    """Points of N sets of views of C cameras; NaN: there is none."""

    position_m: Array  # (N, 3)
    noise_m2: Array  # (N, 3, 3)
    residual_px: Array  # (C, N, 2); 0 where a camera has no view
    worst_sigmas: Array  # (N,)

    def replace(self, at: NDArray[np.int64], other: "_Fit", of: NDArray[np.int64]) -> None:
        self.position_m[at] = other.position_m[of]
        self.noise_m2[at] = other.noise_m2[of]
        self.residual_px[:, at] = other.residual_px[:, of]
        self.worst_sigmas[at] = other.worst_sigmas[of]


def _inverse(matrices: Array) -> Array:
    """Of (N, 3, 3); NaN where there is none."""
    usable = np.isfinite(matrices).all((1, 2))
    usable[usable] = np.linalg.det(matrices[usable]) != 0
    result = np.full_like(matrices, np.nan)
    result[usable] = np.linalg.inv(matrices[usable])
    return result


@dataclass
class _Views:
    """What C cameras see of N points.

    Attributes:
        pixels: (C, N, 2).
        bearings: (C, N, 3), unit vectors in the rig frame. NaN: the lens has no ray.
    """

    pixels: Array
    bearings: Array

    @classmethod
    def of(cls, cameras: list[Camera], pixels: Array) -> "_Views":
        bearings = [camera.rays(own) for camera, own in zip(cameras, pixels)]
        return cls(pixels, np.stack(bearings))

    def at(self, points: NDArray[np.int64]) -> "_Views":
        return _Views(self.pixels[:, points], self.bearings[:, points])


def _nearest_rays(cameras: list[Camera], bearings: Array, seen: Mask) -> Array:
    """The points nearest all rays by the sum of squared distances, (N, 3)."""
    count = bearings.shape[1]
    normal, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    first, widest = np.full((count, 3), np.nan), np.zeros(count)
    has_ray = np.ones(count, dtype=bool)
    for camera, own, sees in zip(cameras, bearings, seen):
        at = np.flatnonzero(sees)
        bearing = own[at]
        has_ray[at] &= np.isfinite(bearing).all(-1)
        across = np.eye(3) - bearing[:, :, None] * bearing[:, None, :]
        normal[at] += across
        right[at] += across @ camera.position_m
        first[at] = np.where(np.isnan(first[at]), bearing, first[at])
        apart = np.linalg.norm(np.cross(first[at], bearing), axis=-1)
        widest[at] = np.maximum(widest[at], apart)
    points = np.einsum("nij,nj->ni", _inverse(normal), right)
    points[~(has_ray & (widest > _MIN_SIN_BETWEEN_RAYS) & (seen.sum(0) >= 2))] = np.nan
    return points


def _fit(cameras: list[Camera], views: _Views, seen: Mask, sigma_px: Array) -> _Fit:
    """Least squares of the weighted reprojection error, by Gauss and Newton's method.

    Args:
        cameras: C of them.
        views: Of N points.
        seen: (C, N).
        sigma_px: (C,), one sigma of each coordinate.
    """
    count = seen.shape[1]
    fit = _Fit(
        position_m=np.full((count, 3), np.nan),
        noise_m2=np.full((count, 3, 3), np.nan),
        residual_px=np.zeros((len(cameras), count, 2)),
        worst_sigmas=np.full(count, np.nan),
    )
    points = _nearest_rays(cameras, views.bearings, seen)
    active = np.flatnonzero(np.isfinite(points).all(-1))
    for step in range(_FIT_STEPS + 1):
        if active.size == 0:
            break
        normal, gradient = np.zeros((active.size, 3, 3)), np.zeros((active.size, 3))
        residuals = np.zeros((len(cameras), active.size, 2))
        for c, camera in enumerate(cameras):
            own = np.flatnonzero(seen[c, active])
            at = active[own]
            projection = camera.lens.project_with_derivatives(camera.to_camera(points[at]))
            jacobian = projection.d_point @ camera.rotation_cam_from_rig / sigma_px[c]
            residual = projection.pixels - views.pixels[c, at]
            residuals[c, own] = residual
            normal[own] += np.swapaxes(jacobian, 1, 2) @ jacobian
            gradient[own] += np.einsum("nij,ni->nj", jacobian, residual / sigma_px[c])
        # A camera that does not see its point makes all of it NaN.
        inverse = _inverse(normal)
        delta = -np.einsum("nij,nj->ni", inverse, gradient)
        length = np.linalg.norm(delta, axis=-1)
        done = np.flatnonzero((length < _FIT_ENOUGH_M) | (step == _FIT_STEPS) & ~np.isnan(length))
        at = active[done]
        fit.position_m[at] = points[at]
        fit.noise_m2[at] = inverse[done]
        fit.residual_px[:, at] = residuals[:, done]
        sigmas = np.linalg.norm(residuals[:, done], axis=-1) / sigma_px[:, None]
        fit.worst_sigmas[at] = sigmas.max(axis=0, initial=0)
        going = ~np.isnan(length)
        going[done] = False
        points[active[going]] += delta[going]
        active = active[going]
    return fit


def _leave_out(
    cameras: list[Camera], views: _Views, seen: Mask, sigma_px: Array, max_sigmas: float, fit: _Fit
) -> None:
    """Takes out the view without which the others agree best, until all of a point agree.

    Changes `fit` and `seen`; where two views do not agree, the point becomes NaN.
    """
    while True:
        odd = np.flatnonzero(~(fit.worst_sigmas <= max_sigmas) & (seen.sum(0) >= 3))
        if odd.size == 0:
            break
        best = _fit(cameras, views.at(odd), np.zeros((len(cameras), odd.size), bool), sigma_px)
        best_out = np.full(odd.size, -1)
        for out in range(len(cameras)):
            trial = np.flatnonzero(seen[out, odd])
            others = seen[:, odd[trial]]
            others[out] = False
            fitted = _fit(cameras, views.at(odd[trial]), others, sigma_px)
            better = np.flatnonzero(
                (fitted.worst_sigmas < best.worst_sigmas[trial])
                | (np.isnan(best.worst_sigmas[trial]) & ~np.isnan(fitted.worst_sigmas))
            )
            best.replace(trial[better], fitted, better)
            best_out[trial[better]] = out
        left = np.flatnonzero(best_out >= 0)
        seen[best_out[left], odd[left]] = False
        fit.replace(odd[left], best, left)
        # No choice of the others has a point.
        seen[:, odd[best_out < 0]] = False
    bad = ~(fit.worst_sigmas <= max_sigmas)
    seen[:, bad] = False
    fit.position_m[bad] = fit.noise_m2[bad] = np.nan


def _sphere_views(
    cameras: list[Camera], views: _Views, seen: Mask, diameter_m: float, fit: _Fit
) -> _Views:
    """With the centres of the spheres' images moved to the images of their centres."""
    pixels = views.pixels.copy()
    has_point = np.isfinite(fit.position_m).all(-1)
    for c, camera in enumerate(cameras):
        at = np.flatnonzero(seen[c] & has_point)
        distance_m = np.linalg.norm(fit.position_m[at] - camera.position_m, axis=-1)
        moved = sphere_centres(camera.lens, pixels[c, at], distance_m, diameter_m)
        pixels[c, at] = np.where(np.isfinite(moved), moved, pixels[c, at])
    return _Views.of(cameras, pixels)


def _calibration_part(
    cameras: list[Camera],
    covariance: CameraCovariance,
    seen: Mask,
    sigma_px: Array,
    fit: _Fit,
) -> Array:
    """Covariance of the points by the errors of the calibration, to first order, (N, 3, 3)."""
    pull = np.zeros((len(fit.position_m), 3, len(covariance.matrix)))
    for c, camera in enumerate(cameras):
        pose, intrinsics = covariance.pose_row[c], covariance.intrinsics_row[c]
        if pose < 0 and intrinsics < 0:
            continue
        at = np.flatnonzero(seen[c])
        rotation = camera.rotation_cam_from_rig
        rotated = fit.position_m[at] @ rotation.T
        projection = camera.lens.project_with_derivatives(rotated + camera.cam_from_rig[:3, 3])
        weighted = np.swapaxes(projection.d_point @ rotation, 1, 2) / sigma_px[c] ** 2
        if pose >= 0:
            by_cam = weighted @ projection.d_point
            # d (rotation vector x point) / d rotation vector = -[point]x, row by row.
            pull[at, :, pose : pose + 3] += np.cross(rotated[:, None, :], by_cam)
            pull[at, :, pose + 3 : pose + 6] += by_cam
        if intrinsics >= 0:
            size = projection.d_intrinsics.shape[2]
            pull[at, :, intrinsics : intrinsics + size] += weighted @ projection.d_intrinsics
    gain = -fit.noise_m2 @ pull
    return gain @ covariance.matrix @ np.swapaxes(gain, 1, 2)


def triangulate_views(
    cameras: list[Camera],
    pixels: Array,
    sigma_px: Array,
    *,
    covariance: CameraCovariance | None,
    scale_sigma_rel: float,
    max_sigmas: float,
    diameter_m: float,
) -> TriangulatedPoints:
    """Points from views of each of them; see Calibration.triangulate.

    Args:
        cameras: C of them.
        pixels: (C, N, 2); NaN: not seen.
        sigma_px: (C,), one sigma of each coordinate of a centre.
        covariance: Of the cameras, in their order. None: not known.
        scale_sigma_rel: One sigma of every length, as a share of it.
        max_sigmas: A view further than this from the point of all its views is left out.
        diameter_m: Of the spheres whose image centres the pixels are; 0: the pixels are of the
            points themselves.
    """
    columns = 3 * len(covariance.matrix) if covariance else 0
    step = max(1, _CHUNK_NUMBERS // max(columns, 24 * len(cameras)))
    parts = [
        _triangulate_block(
            cameras,
            pixels[:, i : i + step],
            sigma_px,
            covariance,
            scale_sigma_rel,
            max_sigmas,
            diameter_m,
        )
        for i in range(0, max(pixels.shape[1], 1), step)
    ]
    position, total, noise, error, used = (np.concatenate(arrays) for arrays in zip(*parts))
    names = tuple(camera.name for camera in cameras)
    return TriangulatedPoints(position, total, noise, error, used, names, covariance is not None)


def _triangulate_block(
    cameras: list[Camera],
    pixels: Array,
    sigma_px: Array,
    covariance: CameraCovariance | None,
    scale_sigma_rel: float,
    max_sigmas: float,
    diameter_m: float,
) -> tuple[Array, Array, Array, Array, Mask]:
    seen = np.isfinite(pixels).all(-1)
    with np.errstate(all="ignore"):
        views = _Views.of(cameras, pixels)
        fit = _fit(cameras, views, seen, sigma_px)
        if diameter_m > 0:
            views = _sphere_views(cameras, views, seen, diameter_m, fit)
            fitted = np.flatnonzero(np.isfinite(fit.position_m).all(-1))
            again = _fit(cameras, views.at(fitted), seen[:, fitted], sigma_px)
            fit.replace(fitted, again, np.arange(fitted.size))
        _leave_out(cameras, views, seen, sigma_px, max_sigmas, fit)
        total = fit.noise_m2.copy()
        if covariance is not None:
            total += _calibration_part(cameras, covariance, seen, sigma_px, fit)
        total += scale_sigma_rel**2 * fit.position_m[:, :, None] * fit.position_m[:, None, :]
        squares = np.where(seen[:, :, None], fit.residual_px, 0) ** 2
        error_px = np.sqrt(squares.sum((0, 2)) / seen.sum(0))
    error_px[~np.isfinite(fit.position_m).all(-1)] = np.nan
    return fit.position_m, total, fit.noise_m2, error_px, seen.T.copy()
