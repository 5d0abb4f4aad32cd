# SPDX-License-Identifier: Apache-2.0
"""Spheres as a camera images them.

A sphere's outline is the cut of a circular cone about the ray to its centre: an ellipse, whose
centroid is not the projection of the sphere's centre (eccentricity of spherical targets: Luhmann,
2014, Photogrammetric Record 29, 424-443).
"""

import numpy as np
from numpy.typing import NDArray

from rigcal.lens import Lens

Array = NDArray[np.float64]

_OUTLINE_STEPS = 16  # the integrands are periodic: equal steps converge faster than any power
_ITERATIONS = 3  # the offset changes over the image much more slowly than by its own size


def _orthogonal(axes: Array) -> Array:
    """Unit vectors at right angles to unit vectors (N, 3)."""
    least = np.zeros_like(axes)
    least[np.arange(len(axes)), np.argmin(np.abs(axes), axis=-1)] = 1
    across = np.cross(axes, least)
    return across / np.linalg.norm(across, axis=-1, keepdims=True)


def _centroid_minus_centre(lens: Lens, centres_cam: Array, diameter_m: float) -> Array:
    """In pixels, (N, 2), of spheres around (N, 3); NaN where the outline is not seen as a whole.

    Area and first moments of the image follow from integrals along the outline (Green's theorem).
    """
    distance = np.linalg.norm(centres_cam, axis=-1, keepdims=True)
    sine = 0.5 * diameter_m / distance
    sine[~((sine > 0) & (sine < 1))] = np.nan
    cosine = np.sqrt(1 - sine * sine)
    axis = centres_cam / distance
    across = _orthogonal(np.nan_to_num(axis, nan=1.0))
    up = np.cross(axis, across)
    centre = lens.project(centres_cam)
    area, moment = np.zeros(len(centre)), np.zeros_like(centre)
    for angle in 2 * np.pi * np.arange(_OUTLINE_STEPS) / _OUTLINE_STEPS:
        c, s = np.cos(angle), np.sin(angle)
        seen = lens.project_with_derivatives(cosine * axis + sine * (c * across + s * up))
        step = np.einsum("nij,nj->ni", seen.d_point, sine * (c * up - s * across))
        p = seen.pixels - centre
        area += 0.5 * (p[:, 0] * step[:, 1] - p[:, 1] * step[:, 0])
        moment[:, 0] += 0.5 * p[:, 0] ** 2 * step[:, 1]
        moment[:, 1] -= 0.5 * p[:, 1] ** 2 * step[:, 0]
    return moment / np.where(np.abs(area) > 0, area, np.nan)[:, None]


def sphere_centres(lens: Lens, centroids_px: Array, distance_m: Array, diameter_m: float) -> Array:
    """Where the centres of spheres project to whose images have these centroids.

    Args:
        lens: Of the camera.
        centroids_px: (N, 2).
        distance_m: (N,), of the spheres' centres from the camera.
        diameter_m: Of the spheres.

    Returns:
        (N, 2), pixels. NaN where the lens has no ray, or does not see all of the outline.
    """
    centres = centroids_px.copy()
    with np.errstate(all="ignore"):
        for _ in range(_ITERATIONS):
            centres_cam = lens.directions(centres) * distance_m[:, None]
            centres = centroids_px - _centroid_minus_centre(lens, centres_cam, diameter_m)
    return centres
