# SPDX-License-Identifier: Apache-2.0
"""Screens, paper, mugs, bottles, balls and fruit on a desk of which x is the middle."""
import cv2
import numpy as np

from posters import poster
from textures import any_colour, bulged_thing, plain, warm_colour

F = np.float32


def draw(room, x, surface, z, width, density):
    for _ in range(room.rng.poisson(room.style.screens)):
        _draw_screen(room, x, surface, z, width, density)
    for _ in range(room.rng.poisson(1.5)):
        _draw_paper(room, x, surface, z, width)
    for _ in range(room.rng.poisson(2.2)):
        _draw_small_thing(room, x, surface, z, width, density)


def _draw_screen(room, x, surface, z, desk_width, density):
    rng, quad = room.rng, room.painter.quad
    width, height = rng.uniform(0.45, 0.65), rng.uniform(0.28, 0.38)
    x += rng.uniform(-desk_width / 2 + width / 2, desk_width / 2 - width / 2)
    content = poster(rng, max(8, int(height * density)), max(8, int(width * density))) \
        * F(rng.uniform(80, 300)) * np.array([0.9, 0.97, 1.1], F)
    black = np.full((8, 8, 3), 0.05, F) * room.white
    quad((x - 0.04, surface - 0.14, z + 0.46), (0.08, 0, 0), (0, 0.14, 0), black)
    quad((x - width / 2 - 0.015, surface - height - 0.13, z + 0.45), (width + 0.03, 0, 0),
         (0, height + 0.03, 0), black)
    quad((x - width / 2, surface - height - 0.115, z + 0.449), (width, 0, 0), (0, height, 0),
         content + F(0.02) * room.white)


def _draw_paper(room, x, surface, z, desk_width):
    rng = room.rng
    x += rng.uniform(-desk_width / 2, desk_width / 2 - 0.25)
    room.painter.quad((x, surface - 0.002, z + rng.uniform(0.05, 0.4)),
                      (0.21, 0, rng.uniform(-.05, .05)), (0.02, 0, 0.28),
                      room.lit(plain(rng, 40, 30, (0.8, 0.8, 0.78))))


def _draw_small_thing(room, x, surface, z, desk_width, density):
    rng = room.rng
    x += rng.uniform(-desk_width / 2 + 0.1, desk_width / 2 - 0.1)
    z += rng.uniform(0.05, 0.4)
    kind = rng.random()
    colour = warm_colour(rng) if rng.random() < 0.45 else any_colour(rng)
    width, height = (0.09, 0.1) if kind < 0.5 else (0.07, 0.24) if kind < 0.7 else (0.08, 0.08)
    h, w = max(6, int(height * density * 1.5)), max(6, int(width * density * 1.5))
    if kind >= 0.7:  # a ball
        texture, mask = bulged_thing(rng, h, w, colour, lambda m: cv2.ellipse(
            m, (w // 2, h // 2), (w // 2 - 1, h // 2 - 1), 0, 0, 360, 255, -1, cv2.LINE_AA))
    else:
        _, mask = bulged_thing(rng, h, w, colour, lambda m: cv2.rectangle(
            m, (1, 1), (w - 2, h - 1), 255, -1))
        across = np.linspace(-1, 1, w, dtype=F)
        shade = 0.4 + 0.6 * np.sqrt(1 - 0.95 * across ** 2)
        texture = plain(rng, h, w, colour) * shade[None, :, None]
    room.painter.upright(x, surface, z, width, height, room.lit(texture), mask)
