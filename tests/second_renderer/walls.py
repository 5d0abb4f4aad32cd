# SPDX-License-Identifier: Apache-2.0
"""Ceiling, floor and walls of a room, and what is on them."""
import cv2
import numpy as np

from posters import poster
from shelves import shelf
from textures import carpet, of_size, plain, wood
from windows import window

F = np.float32

WALL_COLOURS = [(0.75, 0.74, 0.70), (0.70, 0.72, 0.74), (0.66, 0.60, 0.48), (0.55, 0.58, 0.55),
                (0.72, 0.68, 0.60), (0.60, 0.42, 0.30), (0.78, 0.78, 0.78)]
CARPET_COLOURS = [(0.12, 0.13, 0.15), (0.25, 0.22, 0.18), (0.10, 0.14, 0.22), (0.3, 0.1, 0.06)]
BEHIND_M = 0.5  # by how much the room extends behind the camera


def _back_density(room):
    """Pixels per metre of the back wall."""
    return room.painter.density((0, 0, room.depth))


def draw_shell(room):
    wall_colour = np.array(WALL_COLOURS[room.rng.integers(len(WALL_COLOURS))], F)
    density = room.painter.density((0, 0, 3))
    _draw_ceiling(room, min(density, 160))
    _draw_floor(room, min(density, 220))
    _draw_side_walls(room, min(density, 200), wall_colour)
    _draw_back_wall(room, wall_colour)


def _draw_ceiling(room, density):
    rng, length = room.rng, room.depth + BEHIND_M
    texture = of_size(room.width, length, density, lambda h, w: plain(rng, h, w, (0.8, 0.8, 0.78)))
    if rng.random() < 0.6:
        grid = int(0.6 * density)
        texture[::grid] *= 0.7
        texture[:, ::grid] *= 0.7
    room.painter.quad((room.left, room.top, -BEHIND_M), (room.width, 0, 0), (0, 0, length),
                      room.lit(texture, (0, -0.1)) * F(0.8))


def _draw_floor(room, density):
    rng, length = room.rng, room.depth + BEHIND_M
    kind = rng.random()
    colour = CARPET_COLOURS[rng.integers(len(CARPET_COLOURS))]
    if kind < 0.5:
        texture = of_size(room.width, length, density, lambda h, w: carpet(rng, h, w, colour))
    elif kind < 0.85:
        texture = of_size(room.width, length, density,
                          lambda h, w: wood(rng, h, w, along_x=False))
    else:
        texture = of_size(room.width, length, density,
                          lambda h, w: plain(rng, h, w, (0.45, 0.44, 0.42), 0.02, 0.08))
    if kind >= 0.5:  # boards or tiles
        board = max(6, int(0.14 * density))
        for x in range(0, texture.shape[1], board):
            texture[:, x:x + 1] *= 0.55
            texture[:, x:x + board] *= F(rng.uniform(0.8, 1.15))
    room.painter.quad((room.left, room.floor, -BEHIND_M), (room.width, 0, 0), (0, 0, length),
                      room.lit(texture, (0, 0.1)))


def _draw_side_walls(room, density, colour):
    length = room.depth + BEHIND_M
    for x in (room.left, room.right):
        texture = of_size(length, room.height, density,
                          lambda h, w: plain(room.rng, h, w, colour))
        room.painter.quad((x, room.top, -BEHIND_M), (0, 0, length), (0, room.height, 0),
                          room.lit(texture, (0.0, -0.1)) * F(0.85))


def _draw_back_wall(room, colour):
    rng, density = room.rng, _back_density(room)
    texture = of_size(room.width, room.height, density, lambda h, w: plain(rng, h, w, colour))
    if rng.random() < 0.12:
        texture = of_size(room.width, room.height, density,
                          lambda h, w: wood(rng, h, w, along_x=False))
    h, w = texture.shape[:2]
    x = np.abs(np.linspace(-1, 1, w, dtype=F))[None, :, None]
    y = np.linspace(0, 1, h, dtype=F)[:, None, None]
    texture = texture * (1 - 0.25 * x ** 8) * (1 - 0.15 * y ** 6)
    texture[-max(2, int(0.08 * density)):] = 0.6  # skirting board
    room.painter.quad((room.left, room.top, room.depth), (room.width, 0, 0), (0, room.height, 0),
                      room.lit(texture, (0.1, -0.1)))


def draw_ceiling_lights(room):
    if room.lux <= 40:
        return
    rng = room.rng
    for _ in range(rng.poisson(room.style.lamps * 1.6)):
        x = rng.uniform(room.left + 0.6, room.right - 0.6)
        z = rng.uniform(1.5, room.depth - 0.8)
        width, length = (1.2, 0.3) if rng.random() < 0.5 else (0.6, 0.6)
        light = np.full((24, 48, 3), 1, F) * np.array([1, 0.97, 0.9], F) \
            * F(rng.uniform(1500, 6000))
        room.painter.quad((x - width / 2, room.top + 0.01, z - length / 2), (width, 0, 0),
                          (0, 0, length), light)


class _BackWall:
    """Free places along the back wall."""

    def __init__(self, room):
        self.room = room
        self.taken = []

    def place(self, width):
        """The left end of a free place, or None."""
        low, high = self.room.left, self.room.right - width
        for _ in range(12):
            if high <= low:
                return None
            x = self.room.rng.uniform(low, high)
            if all(x > end + 0.08 or x + width < begin - 0.08 for begin, end in self.taken):
                self.taken.append((x, x + width))
                return x
        return None


def draw_things_on_walls(room):
    rng, style = room.rng, room.style
    back_wall = _BackWall(room)
    for _ in range(rng.poisson(style.windows)):
        _draw_window(room, back_wall)
    if rng.random() < 0.45:
        _draw_door(room, back_wall)
    for _ in range(rng.poisson(style.shelves)):
        _draw_shelf(room, back_wall)
    for _ in range(rng.poisson(1.2)):
        _draw_poster(room, back_wall)
    if rng.random() < 0.5:
        _draw_side_shelf(room)


def _draw_window(room, back_wall):
    rng, style = room.rng, room.style
    width, height = rng.uniform(0.9, 2.2), rng.uniform(0.9, 1.5)
    on_side = rng.random() < 0.35
    density = room.painter.density((0, 0, 3)) if on_side else _back_density(room)
    light, surface = window(rng, width, height, density, style.outside * rng.uniform(0.5, 1.5),
                            rng.random() < 0.55)
    texture = light + surface * room.white * F(0.8) \
        + surface * F(0.02 * style.outside / np.pi)
    y = room.top + rng.uniform(0.3, max(0.35, room.height - height - 0.8))
    if on_side:
        x = room.left + 0.01 if rng.random() < 0.5 else room.right - 0.01
        z = rng.uniform(1.0, max(1.1, room.depth - width - 0.2))
        room.painter.quad((x, y, z), (0, 0, width), (0, height, 0), texture)
        return
    x = back_wall.place(width)
    if x is None:
        return
    room.painter.quad((x, y, room.depth - 0.01), (width, 0, 0), (0, height, 0), texture)
    sill = room.lit(plain(rng, 8, max(8, int(width * density)), (0.7, 0.7, 0.7))) * F(1.3)
    room.painter.quad((x - 0.05, y + height, room.depth - 0.08), (width + 0.1, 0, 0), (0, 0.04, 0),
                      sill)


def _draw_door(room, back_wall):
    rng, density = room.rng, _back_density(room)
    width, height = 0.95, 2.05
    x = back_wall.place(width)
    if x is None:
        return
    texture = of_size(width, height, density, lambda h, w: wood(rng, h, w, along_x=False)
                      if rng.random() < 0.6 else plain(rng, h, w, (0.6, 0.6, 0.58)))
    frame = max(2, int(0.05 * density))
    texture[:frame] *= 0.6
    texture[:, :frame] *= 0.6
    texture[:, -frame:] *= 0.6
    handle = (int(0.85 * texture.shape[1]), texture.shape[0] // 2)
    cv2.circle(texture, handle, max(2, frame // 2), (0.7, 0.65, 0.5), -1, cv2.LINE_AA)
    room.painter.quad((x, room.floor - height, room.depth - 0.01), (width, 0, 0), (0, height, 0),
                      room.lit(texture))


def _draw_shelf(room, back_wall):
    rng, density = room.rng, _back_density(room)
    width, height, deep = rng.uniform(0.7, 1.8), min(rng.uniform(1.1, 2.2), room.height - 0.2), 0.3
    x = back_wall.place(width)
    if x is None:
        return
    books = shelf(rng, width, height, density)
    side = wood(rng, max(4, int(height * density)), max(4, int(deep * density)), along_x=False)
    y, z = room.floor - height, room.depth - deep
    for side_x in (x + width, x):
        room.painter.quad((side_x, y, z), (0, 0, deep), (0, height, 0), room.lit(side) * F(0.7))
    room.painter.quad((x, y, z), (width, 0, 0), (0, height, 0), room.lit(books, (0.05, -0.1)))


def _draw_poster(room, back_wall):
    rng, density = room.rng, _back_density(room)
    width, height = rng.uniform(0.3, 1.2), rng.uniform(0.3, 0.9)
    x = back_wall.place(width)
    if x is None:
        return
    texture = 0.75 * of_size(width, height, density, lambda h, w: poster(rng, h, w))
    border = max(1, int(0.02 * density))
    for edge in (texture[:border], texture[-border:], texture[:, :border], texture[:, -border:]):
        edge[:] = 0.1
    room.painter.quad((x, max(room.top + 0.3, room.floor - 2.0), room.depth - 0.01),
                      (width, 0, 0), (0, height, 0), room.lit(texture))


def _draw_side_shelf(room):
    rng = room.rng
    width, height = rng.uniform(0.8, 2.0), min(rng.uniform(0.9, 2.0), room.height - 0.2)
    x = room.left + 0.32 if rng.random() < 0.5 else room.right - 0.32
    z = rng.uniform(1.8, max(1.9, room.depth - width - 0.3))
    if room.style.shelves > 0.3:
        books = shelf(rng, width, height, room.painter.density((x, 0, z + width / 2)))
        room.painter.quad((x, room.floor - height, z), (0, 0, width), (0, height, 0),
                          room.lit(books) * F(0.85))
