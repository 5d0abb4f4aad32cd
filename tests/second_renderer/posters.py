# SPDX-License-Identifier: Apache-2.0
"""What posters and screens show."""
import cv2
import numpy as np

from photographs import find_photographs, part_of_photograph
from textures import any_colour, warm_colour

F = np.float32


def poster(rng, h, w):
    """A photograph, windows with text, or shapes; 0..1."""
    kind = rng.random()
    if kind < 0.45 and find_photographs():
        return part_of_photograph(rng, h, w)
    page = np.full((h, w, 3), rng.uniform(0.5, 0.95), F)
    if kind < 0.75:
        for _ in range(rng.integers(1, 4)):
            _draw_text_window(rng, page)
    else:
        for _ in range(rng.integers(3, 12)):
            _draw_shape(rng, page)
    return page


def _draw_text_window(rng, page):
    h, w = page.shape[:2]
    x0, y0 = int(rng.uniform(0, 0.6) * w), int(rng.uniform(0, 0.6) * h)
    x1, y1 = x0 + int(rng.uniform(0.3, 0.6) * w), y0 + int(rng.uniform(0.3, 0.6) * h)
    ground = rng.choice([0.02, 0.9])
    page[y0:y1, x0:x1] = ground
    page[y0:y0 + max(2, h // 40), x0:x1] = any_colour(rng)
    for y in range(y0 + h // 18, min(y1, h) - 2, max(3, h // 30)):
        x = x0 + w // 60
        while x < min(x1, w) - 4:
            run = int(rng.integers(2, 12))
            page[y:y + max(1, h // 80), x:min(x + run, x1)] = \
                (1 - ground) * (any_colour(rng) if rng.random() < 0.2 else 0.7)
            x += run + 3
            if rng.random() < 0.08:
                break


def _draw_shape(rng, page):
    h, w = page.shape[:2]
    colour = [float(q) for q in (warm_colour(rng) if rng.random() < 0.4 else any_colour(rng))]
    p = (int(rng.uniform(0, w)), int(rng.uniform(0, h)))
    radius = int(rng.uniform(0.03, 0.25) * min(h, w))
    if rng.random() < 0.5:
        cv2.circle(page, p, radius, colour, -1, cv2.LINE_AA)
    else:
        cv2.rectangle(page, p, (p[0] + 2 * radius, p[1] + radius), colour, -1)
