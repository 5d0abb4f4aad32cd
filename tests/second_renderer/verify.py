#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Checks the renderer against things it does not use: OpenCV's projection, the analytic outline
of a projected sphere, and a sphere hit by 64 x 64 rays a pixel. Fails where a bound is exceeded."""
import installed_packages  # first: it may end the program

import argparse
import sys

import cv2
import numpy as np

from camera import HEIGHT, WIDTH, Camera
from light import Light
from outline import outline, polygon_moments
from shapes import SPHERE_RADIUS_M, Ball, Capsule
from tracer import trace

FINE = 64  # rays a pixel and axis of the brute force

# What is measured: the largest value allowed, and the unit. Coverage of whole pixels gives the
# centroid of a disc of 5 px to about 0.003 px, however exact the coverage.
BOUNDS = {
    "inverse of the projection": (1e-7, "px"),
    "projection, against OpenCV": (1e-9, "px"),
    "centroid by brute force, against the outline": (5e-4, "px"),
    "centroid of 144 rays, against the outline": (0.01, "px"),
    "centroid of 256 rays, against the outline": (0.006, "px"),
    "centroid of 256 rays, against brute force": (0.005, "px"),
    "area of 144 rays, against the outline": (0.0015, "of it"),
    "area of 256 rays, against the outline": (0.0015, "of it"),
    "coverage of a pixel by 256 rays, against brute force": (0.05, ""),
    "moving and blinking: centroid of the light": (0.02, "px"),
    "moving and blinking: mean error of the centroid": (0.004, "px"),
    "capsule of no length, against a ball": (5e-4, "m"),
    "capsule of no length: rays that miss it but not the ball": (0, ""),
}


class Measured:
    def __init__(self):
        self.values = {what: [] for what in BOUNDS}

    def note(self, what, value):
        self.values[what].append(float(value))

    def print(self):
        """Returns whether all are within their bounds."""
        is_good = True
        for what, (bound, unit) in BOUNDS.items():
            worst = max(self.values[what])
            within = worst <= bound  # false for what is not a number
            is_good &= within
            print(f"{what:60s} mean {np.mean(self.values[what]):8.2g}  worst {worst:8.2g}  "
                  f"allowed {bound:g} {unit}{'' if within else '  EXCEEDED'}")
        return is_good


def brute_force(camera, centre, x0, y0, x1, y1):
    """Coverage of the pixels by rays through a fine grid, and the centroid of the grid's points
    that hit; undistorted by OpenCV, hit by a quadratic equation."""
    u = x0 - 0.5 + (np.arange((x1 - x0) * FINE) + 0.5) / FINE
    v = y0 - 0.5 + (np.arange((y1 - y0) * FINE) + 0.5) / FINE
    grid = np.stack(np.meshgrid(u, v), -1).reshape(-1, 1, 2)
    ray = cv2.undistortPointsIter(grid, camera.matrix(), camera.distortion, None, None,
                                  (cv2.TERM_CRITERIA_COUNT, 12, 0))[:, 0]
    d = np.concatenate([ray, np.ones((len(ray), 1))], 1)
    a, b, c = (d * d).sum(1), d @ centre, centre @ centre - SPHERE_RADIUS_M ** 2
    hit = b * b - a * c > 0
    cover = hit.reshape(y1 - y0, FINE, x1 - x0, FINE).mean((1, 3))
    return cover, grid[hit, 0].mean(0)


def centroid(cover, x0, y0):
    y, x = np.mgrid[0:cover.shape[0], 0:cover.shape[1]]
    return np.array([(cover * x).sum(), (cover * y).sum()]) / cover.sum() + [x0, y0]


def somewhere(rng, nearest, farthest):
    """A camera, a pixel away from its border and a place that it shows there."""
    camera = Camera(rng)
    z = rng.uniform(nearest, farthest)
    pixel = np.array([rng.uniform(80, WIDTH - 80), rng.uniform(80, HEIGHT - 80)])
    x, y = camera.rays(*pixel)
    return camera, pixel, np.array([x, y, 1]) * z


def distance(a, b):
    return np.hypot(*(a - b))


def check_still_sphere(seed, by_force, measured):
    camera, pixel, centre = somewhere(np.random.default_rng(seed), 0.9, 6)
    shown = camera.project(centre)
    measured.note("inverse of the projection", distance(shown, pixel))
    by_opencv = cv2.projectPoints(centre.reshape(1, 3), np.zeros(3), np.zeros(3), camera.matrix(),
                                  camera.distortion)[0].ravel()
    measured.note("projection, against OpenCV", distance(shown, by_opencv))
    area, middle = polygon_moments(outline(camera, centre, SPHERE_RADIUS_M, 4000))
    reach = int(SPHERE_RADIUS_M * camera.focal_px / centre[2] * 1.2) + 4
    (x0, y0), (x1, y1) = pixel.astype(int) - reach, pixel.astype(int) + reach + 1
    ball = Ball(centre, SPHERE_RADIUS_M, np.zeros(3), led=np.zeros(3))
    for rays in (144, 256):
        image = np.ones((HEIGHT, WIDTH, 3), np.float32)  # black where the ball is
        trace(camera, image, [ball], Light(), rays)
        cover = 1 - image[y0:y1, x0:x1, 0].astype(float)
        measured.note(f"centroid of {rays} rays, against the outline",
                      distance(centroid(cover, x0, y0), middle))
        measured.note(f"area of {rays} rays, against the outline", abs(cover.sum() / area - 1))
    if not by_force:
        return
    exact, fine_middle = brute_force(camera, centre, x0, y0, x1, y1)
    measured.note("centroid by brute force, against the outline", distance(fine_middle, middle))
    measured.note("centroid of 256 rays, against brute force",
                  distance(centroid(cover, x0, y0), centroid(exact, x0, y0)))
    measured.note("coverage of a pixel by 256 rays, against brute force",
                  np.abs(exact - cover).max())


def error_of_moving_sphere(seed):
    """The centroid of the light, less the mean of the outlines' at the times with light; None if
    there is little light."""
    rng = np.random.default_rng(seed)
    camera, _, centre = somewhere(rng, 1.5, 4.5)
    velocity = rng.normal(size=3) * rng.choice([0.1, 1.0])
    light = Light(exposure=rng.choice([0.005, 0.001]), phase=rng.random())
    image = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    ball = Ball(centre, SPHERE_RADIUS_M, np.zeros(3), velocity, np.ones(3), limb=0)
    trace(camera, image, [ball], light, 256)
    if image.max() < 0.2:
        return None
    times = (np.arange(200) - 99.5) / 200 * light.exposure
    lit = light.lit(times, light.exposure / 200)
    middles = np.array([polygon_moments(outline(camera, centre + velocity * t, SPHERE_RADIUS_M,
                                                200))[1] for t in times])
    return centroid(image[..., 0].astype(float), 0, 0) - (middles * lit[:, None]).sum(0) / lit.sum()


def check_moving_spheres(count, measured):
    errors = [e for e in map(error_of_moving_sphere, range(count)) if e is not None]
    for error in errors:
        measured.note("moving and blinking: centroid of the light", np.hypot(*error))
    measured.note("moving and blinking: mean error of the centroid",
                  np.hypot(*np.mean(errors, axis=0)))


def check_capsule(measured):
    centre = np.array([0.2, -0.1, 2.0])
    d = np.random.default_rng(1).normal(size=(20000, 3)) * [0.02, 0.02, 0] + centre / 2.0
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    t = np.zeros(len(d))
    of_ball, _ = Ball(centre, SPHERE_RADIUS_M, np.ones(3)).hit(d, t)
    of_capsule, _ = Capsule(centre, centre + [1e-5, 0, 0], SPHERE_RADIUS_M, np.ones(3)).hit(d, t)
    both = np.isfinite(of_ball) & np.isfinite(of_capsule)
    measured.note("capsule of no length, against a ball",
                  np.abs(of_ball[both] - of_capsule[both]).max())
    measured.note("capsule of no length: rays that miss it but not the ball",
                  (np.isfinite(of_ball) != np.isfinite(of_capsule)).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--thorough", action="store_true", help="more places: half a minute")
    args = parser.parse_args()
    measured = Measured()
    by_force = 10 if args.thorough else 4
    for seed in range(40 if args.thorough else 8):
        check_still_sphere(seed, seed < by_force, measured)
    check_moving_spheres(60 if args.thorough else 16, measured)
    check_capsule(measured)
    sys.exit(0 if measured.print() else 1)


if __name__ == "__main__":
    main()
