# SPDX-License-Identifier: Apache-2.0
"""Balls and capsules that may move, and where rays from the camera meet them."""
import numpy as np

WAND_M = np.array([0.0, 0.13, 0.39])  # places of the spheres on the stick
SPHERE_RADIUS_M = 0.02


def dot(a, b):
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def moved(point, velocity, times):
    if velocity.any():
        return point + times[..., None] * velocity
    return np.broadcast_to(point, (1, 1, 3))


class Ball:
    def __init__(self, centre, radius, albedo, velocity=(0, 0, 0), led=None, limb=0.15, slope=None,
                 spot=None):
        self.centre = np.asarray(centre, float)
        self.radius = radius
        self.albedo = np.asarray(albedo, float)
        self.velocity = np.asarray(velocity, float)
        self.led = None if led is None else np.asarray(led, float)  # radiance while lit
        self.limb = limb  # how much darker its rim is
        self.slope = np.zeros(3) if slope is None else np.asarray(slope, float)
        self.spot = spot  # (direction, strength, sharpness)

    def points(self):
        """Balls that cover it: centres and radii."""
        return [(self.centre, self.radius)]

    def gap(self):
        """How far from points() its surface may be, beyond their radius."""
        return 0.0

    def hit(self, d, t):
        """Distance (inf: none) and normal, of unit directions d at times t."""
        c = moved(self.centre, self.velocity, t)
        along = dot(d, c)
        # The vector from the ray's nearest point to the centre: no large numbers are subtracted.
        off = c - along[..., None] * d
        inside = self.radius ** 2 - dot(off, off)
        half = np.sqrt(np.maximum(inside, 0))
        distance = np.where((inside > 0) & (along > 0), along - half, np.inf)
        normal = (-half[..., None] * d - off) / self.radius
        return distance, normal

    def glow(self, normal, d):
        """The LED's light towards the camera, as a share of what an even sphere gives."""
        facing = np.clip(-dot(normal, d), 0, 1)
        shape = (1 - self.limb * (1 - facing)) * (1 + normal @ self.slope)
        if self.spot is not None:
            direction, strength, sharpness = self.spot
            shape = shape * (1 + strength * np.exp(sharpness * (normal @ direction - 1)))
        return np.maximum(shape, 0.02)


class Capsule:
    """All points nearer than the radius to the segment from a to b."""
    POINTS = 25
    led = None

    def __init__(self, a, b, radius, albedo, velocity_a=(0, 0, 0), velocity_b=(0, 0, 0)):
        self.a, self.b = np.asarray(a, float), np.asarray(b, float)
        self.radius = radius
        self.albedo = np.asarray(albedo, float)
        self.velocity = np.asarray(velocity_a, float)
        self.velocity_b = np.asarray(velocity_b, float)
        self.lit_by = []  # balls on this stick whose light it reflects

    def points(self):
        return [(self.a + s * (self.b - self.a), self.radius)
                for s in np.linspace(0, 1, self.POINTS)]

    def gap(self):
        return np.linalg.norm(self.b - self.a) / (2 * (self.POINTS - 1))

    def hit(self, d, t):
        a, b = moved(self.a, self.velocity, t), moved(self.b, self.velocity_b, t)
        axis = b - a
        length2 = dot(axis, axis)
        axis_d, axis_a, d_a = dot(axis, d), dot(axis, a), dot(d, a)
        # |s d - a|^2 - (component along the axis)^2 = radius^2, times length2.
        qa = length2 - axis_d ** 2
        qb = length2 * d_a - axis_a * axis_d
        qc = length2 * (dot(a, a) - self.radius ** 2) - axis_a ** 2
        root2 = qb ** 2 - qa * qc
        s = np.where(root2 > 0, (qb - np.sqrt(np.maximum(root2, 0))) / np.maximum(qa, 1e-12),
                     np.inf)
        with np.errstate(invalid="ignore"):
            share = np.where(np.isfinite(s), (s * axis_d - axis_a) / length2, 0)
        s = np.where((share >= 0) & (share <= 1) & (s > 0), s, np.inf)
        share = np.clip(share, 0, 1)
        for end, end_share in ((a, 0.0), (b, 1.0)):
            along = dot(d, end)
            off = end - along[..., None] * d
            inside = self.radius ** 2 - dot(off, off)
            near = np.where((inside > 0) & (along > 0), along - np.sqrt(np.maximum(inside, 0)),
                            np.inf)
            share = np.where(near < s, end_share, share)
            s = np.minimum(s, near)
        finite = np.where(np.isfinite(s), s, 0)
        on_axis = a + share[..., None] * axis
        normal = (finite[..., None] * d - on_axis) / self.radius
        return s, normal
