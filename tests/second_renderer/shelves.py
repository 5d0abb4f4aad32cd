# SPDX-License-Identifier: Apache-2.0
"""Books on boards."""
import numpy as np

from textures import any_colour, warm_colour, wood

F = np.float32


def shelf(rng, width_m, height_m, density):
    w, h = max(8, int(width_m * density)), max(8, int(height_m * density))
    board = wood(rng, h, w)
    texture = board * F(0.25)
    thick = max(2, int(0.022 * density))
    row = int(rng.uniform(0.27, 0.36) * density)
    y = thick
    while y + row // 2 < h:
        bottom = min(y + row, h - thick)
        _fill_row(rng, texture, y, bottom, thick, density)
        shadow = np.linspace(0.45, 1, max(1, (bottom - y) // 3), dtype=F)
        texture[y:y + len(shadow)] *= shadow[:, None, None]
        texture[bottom:bottom + thick] = board[bottom:bottom + thick]
        y = bottom + thick
    texture[:thick] = board[:thick]
    texture[:, :thick] = board[:, :thick]
    texture[:, -thick:] = board[:, -thick:]
    return texture


def _fill_row(rng, texture, top, bottom, thick, density):
    w = texture.shape[1]
    x = thick + 1
    while x < w - thick - 2:
        if rng.random() < 0.05:
            x += int(rng.uniform(0.03, 0.15) * density)
            continue
        if rng.random() < 0.06:  # something else: a box, a pot
            size = rng.uniform(0.06, 0.2), rng.uniform(0.06, 0.2)
        else:
            size = rng.uniform(0.012, 0.055), rng.uniform(0.17, 0.25)
        width = max(2, min(int(size[0] * density), w - thick - 1 - x))
        height = min(int(size[1] * density), bottom - top - 1)
        if height < 3:
            break
        texture[bottom - height:bottom, x:x + width] = _spine(rng, height, width)
        x += width + (1 if rng.random() < 0.5 else 0)


def _spine(rng, h, w):
    kind = rng.random()
    colour = warm_colour(rng) if kind < 0.3 else np.full(3, rng.uniform(0.1, 0.8), F) \
        if kind < 0.5 else any_colour(rng)
    across = np.linspace(-1, 1, w, dtype=F)
    shade = (0.55 + 0.45 * np.sqrt(np.maximum(1 - 0.9 * across ** 2, 0))) \
        * (0.85 + 0.15 * rng.random())
    spine = np.broadcast_to(shade[None, :, None] * colour, (h, w, 3)).copy()
    spine *= np.linspace(1.0, 0.8, h, dtype=F)[:, None, None]
    if rng.random() < 0.6 and w > 3:  # title
        begin, end = sorted(rng.uniform(0.08, 0.92, 2))
        light = F(rng.choice([0.7, 0.05]))
        rows = np.arange(int(begin * h), int(end * h))
        for row in rows[rng.random(len(rows)) < 0.55]:
            spine[row, w // 3:w - w // 3] = light * (0.4 + 0.6 * rng.random())
    if rng.random() < 0.35:  # bands
        for at in rng.uniform(0, 0.95, rng.integers(1, 3)):
            row = int(at * h)
            spine[row:row + max(1, h // 25)] = any_colour(rng)
    return spine
