# SPDX-License-Identifier: Apache-2.0
"""The outline of a ball in the picture, computed without tracing rays."""
import numpy as np


def outline(camera, centre, radius, count=720):
    """Points of the projected outline, from the cone of tangents to the ball."""
    centre = np.asarray(centre, float)
    distance = np.linalg.norm(centre)
    towards = centre / distance
    a = np.cross(towards, [0.3, 1.0, 0.2])
    a /= np.linalg.norm(a)
    b = np.cross(towards, a)
    sine = radius / distance
    cosine = np.sqrt(1 - sine * sine)
    angle = np.arange(count) * 2 * np.pi / count
    rays = cosine * towards + sine * (np.cos(angle)[:, None] * a + np.sin(angle)[:, None] * b)
    return camera.project(rays)


def polygon_moments(corners):
    """Area and centroid of a polygon."""
    origin = corners.mean(0)
    following = np.roll(corners, -1, 0)
    p, q = corners - origin, following - origin
    cross = p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]
    area = cross.sum() / 2
    return abs(area), origin + ((p + q) * cross[:, None]).sum(0) / (6 * area)


def disc_area(camera, ball):
    return polygon_moments(outline(camera, ball.centre, ball.radius))[0]
