# SPDX-License-Identifier: Apache-2.0
"""Windows: sky, trees or a photograph outside, a frame, and perhaps slats."""
import numpy as np

from photographs import find_photographs, part_of_photograph
from textures import noise

F = np.float32


def window(rng, width_m, height_m, density, outside, has_slats):
    """What comes through (cd/m^2; `outside` is the sky's), and frame and slats as reflectances."""
    w, h = max(16, int(width_m * density)), max(16, int(height_m * density))
    light = _view(rng, h, w) * F(outside)
    surface = np.zeros((h, w, 3), F)
    white = np.asarray(rng.choice([0.75, 0.6, 0.3]), F)
    frame = _frame(rng, h, w, max(3, int(0.05 * density)))
    surface[frame] = white
    light[frame] = 0
    if has_slats:
        pitch = max(4, int(rng.uniform(0.022, 0.05) * density))
        covered = rng.uniform(0.45, 0.85)
        rows = np.arange(h) % pitch
        is_slat = rows < covered * pitch
        is_slat[int(rng.uniform(0.6, 1.0) * h):] = False
        across = np.clip(rows / (covered * pitch), 0, 1)
        colour = np.asarray([(0.75, 0.74, 0.7), (0.6, 0.5, 0.35), (0.5, 0.27, 0.12)]
                            [rng.integers(3)], F)
        leak = (0.03 + 0.10 * across[is_slat])[:, None, None].astype(F)
        light[is_slat] = F(outside) * leak * colour
        surface[is_slat] = colour
    return light, surface


def _view(rng, h, w):
    y = np.linspace(0, 1, h, dtype=F)[:, None]
    sky = np.array([0.85, 0.95, 1.1], F) * (1.1 - 0.4 * y[..., None]) * np.ones((h, w, 1), F)
    trees = 0.55 + 0.12 * noise(rng, 1, w, 1.4, zoom_x=2)[0]
    is_below = y > trees[None, :] if rng.random() < 0.8 else np.zeros((h, w), bool)
    below = np.maximum(0.16 + 0.06 * noise(rng, h, w, 0.9), 0.02)[..., None] \
        * np.array([0.8, 1.0, 0.5], F)
    if find_photographs() and rng.random() < 0.4:
        below = 0.5 * part_of_photograph(rng, h, w)
    return np.where(is_below[..., None], below, sky)


def _frame(rng, h, w, bar):
    frame = np.zeros((h, w), bool)
    frame[:bar] = frame[-bar:] = True
    frame[:, :bar] = frame[:, -bar:] = True
    for i in range(1, int(rng.integers(1, 4))):
        at = int(w * i / 3)
        frame[:, at:at + bar] = True
    return frame
