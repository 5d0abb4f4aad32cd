# SPDX-License-Identifier: Apache-2.0
"""Draws flat things in perspective, the nearer over the farther.

World axes: x right, y down, z into the room; the camera's lens is the origin. What is drawn is
luminance in cd/m^2.
"""
import cv2
import numpy as np

from camera import HEIGHT, WIDTH

F = np.float32
NEAREST_M = 0.1


def rotation(yaw, pitch, roll):
    cy, sy, cp, sp, cr, sr = (np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch),
                              np.cos(roll), np.sin(roll))
    return (np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1.0]])
            @ np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
            @ np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]))


class Painter:
    def __init__(self, camera, camera_from_world):
        self.image = np.zeros((HEIGHT, WIDTH, 3), F)
        self.matrix = camera.matrix()
        self.camera_from_world = camera_from_world

    def density(self, point):
        """Pixels per metre at a place, for textures."""
        z = max(0.4, (self.camera_from_world @ np.asarray(point, float))[2])
        return float(np.clip(self.matrix[0, 0] / z, 40, 900))

    def _outline(self, corners):
        """The projection of the part of a polygon that is before the camera, or None."""
        clipped = []
        for i in range(4):
            a, b = corners[i], corners[(i + 1) % 4]
            if a[2] > NEAREST_M:
                clipped.append(a)
            if (a[2] > NEAREST_M) != (b[2] > NEAREST_M):
                clipped.append(a + (NEAREST_M - a[2]) / (b[2] - a[2]) * (b - a))
        if len(clipped) < 3:
            return None
        p = np.array(clipped) @ self.matrix.T
        return p[:, :2] / p[:, 2:]

    def quad(self, o, u, v, texture, mask=None):
        """Draws a texture on the parallelogram with the corners o, o + u, o + u + v, o + v."""
        o, u, v = (self.camera_from_world @ np.asarray(q, float) for q in (o, u, v))
        h, w = texture.shape[:2]
        p = self._outline([o, o + u, o + u + v, o + v])
        if p is None:
            return
        x0, y0 = np.maximum(np.floor(p.min(0)) - 1, 0).astype(int)
        x1 = int(min(np.ceil(p[:, 0].max()) + 2, WIDTH))
        y1 = int(min(np.ceil(p[:, 1].max()) + 2, HEIGHT))
        if x0 >= x1 or y0 >= y1:
            return
        pixel_from_texel = self.matrix @ np.stack([u / w, v / h, o + 0.5 * u / w + 0.5 * v / h], 1)
        pixel_from_texel = np.array([[1, 0, -x0], [0, 1, -y0], [0, 0, 1.0]]) @ pixel_from_texel
        size = (int(x1 - x0), int(y1 - y0))
        warped = cv2.warpPerspective(texture, pixel_from_texel, size, flags=cv2.INTER_LINEAR,
                                     borderMode=cv2.BORDER_REPLICATE)
        alpha = np.zeros((size[1], size[0]), np.uint8)
        points = np.rint(np.clip((p - [x0, y0]) * 16, -4e5, 4e5)).astype(np.int32)
        cv2.fillConvexPoly(alpha, points, 255, cv2.LINE_AA, 4)
        part = self.image[y0:y1, x0:x1]
        if mask is None and (alpha == 255).all():
            part[:] = warped
            return
        alpha = alpha.astype(F) / 255
        if mask is not None:
            alpha = alpha * cv2.warpPerspective(mask.astype(F) / 255, pixel_from_texel, size,
                                                flags=cv2.INTER_LINEAR)
        part += alpha[..., None] * (warped - part)

    def upright(self, x, y, z, w, h, texture, mask):
        """A thing facing along z whose lower middle is at (x, y, z)."""
        self.quad((x - w / 2, y - h, z), (w, 0, 0), (0, h, 0), texture, mask)
