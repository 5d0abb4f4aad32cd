# SPDX-License-Identifier: Apache-2.0
"""A pinhole camera with Brown distortion.

The centre of the first pixel is (0, 0). Axes: x right, y down, z forward. Metres and pixels.
"""
import cv2
import numpy as np

WIDTH, HEIGHT = 1280, 1024


class Camera:
    """A camera of random lens."""

    def __init__(self, rng):
        self.focal_px = rng.uniform(1100, 1300, 1)[0]
        self.fx = self.focal_px * rng.uniform(0.999, 1.001)
        self.fy = self.focal_px
        self.cx = (WIDTH - 1) / 2 + rng.uniform(-15, 15)
        self.cy = (HEIGHT - 1) / 2 + rng.uniform(-15, 15)
        # k1, k2, p1, p2, k3 as OpenCV has them
        self.distortion = np.array([rng.uniform(-0.12, -0.02), rng.uniform(0.0, 0.06),
                                    rng.uniform(-5e-4, 5e-4), rng.uniform(-5e-4, 5e-4), 0.0])

    def matrix(self):
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def _bend(self, x, y):
        k1, k2, p1, p2, _ = self.distortion
        r2 = x * x + y * y
        radial = r2 * (k1 + k2 * r2)
        return (radial * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                radial * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)

    def project(self, points):
        points = np.asarray(points, float)
        x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
        dx, dy = self._bend(x, y)
        return np.stack([self.fx * (x + dx) + self.cx, self.fy * (y + dy) + self.cy], -1)

    def rays(self, u, v):
        """x and y of the directions (x, y, 1) of pixels, to 1e-7 px by fixed-point iteration."""
        a, b = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        x, y = a, b
        for _ in range(9):
            dx, dy = self._bend(x, y)
            x, y = a - dx, b - dy
        return x, y

    def write(self, path):
        """A calibration as rigcal-agent reads it."""
        file = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
        file.write("image_width", WIDTH)
        file.write("image_height", HEIGHT)
        file.write("camera_matrix", self.matrix())
        file.write("distortion_coefficients", self.distortion.reshape(1, 5))
        file.release()
