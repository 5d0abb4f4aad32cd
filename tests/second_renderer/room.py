# SPDX-License-Identifier: Apache-2.0
"""A room: its size, its light, and drawing it from far to near."""
import numpy as np

import furniture
import walls
from painter import Painter, rotation
from people import PERSON_HEIGHT_M, PERSON_WIDTH_M, person
from textures import noise

F = np.float32


class Style:
    """What is in a room: means of what is drawn at random."""

    def __init__(self, windows=1.0, shelves=1.0, screens=1.0, lamps=1.0, people=0.3, orange=0.3,
                 indicators=1.5, outside=4000.0, tint=0.06):
        self.windows, self.shelves, self.screens, self.lamps = windows, shelves, screens, lamps
        self.people = people
        self.orange = orange          # share of people in orange
        self.indicators = indicators  # small lights of devices
        self.outside = outside        # cd/m^2
        self.tint = tint              # of the light


class Room:
    """Metres from the camera's lens; see painter.py for the axes."""

    def __init__(self, rng, camera, style, lux):
        self.rng, self.style, self.lux = rng, style, lux
        turn = rotation(rng.uniform(-0.35, 0.35), rng.uniform(-0.06, 0.2), rng.uniform(-0.04, 0.04))
        self.painter = Painter(camera, turn)
        self.floor = rng.uniform(1.2, 2.1)
        above = rng.uniform(2.5, 3.3) - self.floor
        self.top = -(above if above >= 0.5 else 0.6)
        self.left, self.right = -rng.uniform(1.8, 4.5), rng.uniform(1.8, 4.5)
        self.depth = rng.uniform(4.8, 8.5)
        self.width, self.height = self.right - self.left, self.floor - self.top
        tint = np.array([1 + rng.uniform(-1, 1) * style.tint, 1,
                         1 - rng.uniform(-1, 1.6) * style.tint])
        self.white = (lux / np.pi * tint).astype(F)  # luminance of white in this light

    def lit(self, texture, gradient=(0.0, 0.0)):
        """Light on a surface: uneven, and falling from one side to the other."""
        h, w = texture.shape[:2]
        field = 1 + 0.12 * noise(self.rng, h, w, 2.4)
        field += F(gradient[0]) * np.linspace(-1, 1, w, dtype=F)[None, :]
        field += F(gradient[1]) * np.linspace(-1, 1, h, dtype=F)[:, None]
        return texture * np.maximum(field, 0.1)[..., None] * self.white


def draw_room(rng, camera, style, lux):
    room = Room(rng, camera, style, lux)
    walls.draw_shell(room)
    walls.draw_ceiling_lights(room)
    walls.draw_things_on_walls(room)
    for z, kind in sorted(_things_on_floor(room), reverse=True):
        x = 0
        if room.width > 1.2:
            x = rng.uniform(max(room.left + 0.5, -0.6 * z - 0.3),
                            min(room.right - 0.5, 0.6 * z + 0.3))
        DRAW[kind](room, x, z, room.painter.density((x, 0.5, z)))
    furniture.draw_indicators(room)
    return room


def _things_on_floor(room):
    """Distances and kinds."""
    style = room.style
    # kind, how many on average, least distance, least distance from the back wall
    kinds = [("desk", 1.6, 2.6, 0.5), ("person", style.people, 2.2, 0.4), ("chair", 1.2, 2.2, 0.3),
             ("plant", 0.9, 2.4, 0.3), ("box", 1.0, 2.4, 0.3), ("sofa", 0.5, 3.0, 0.3),
             ("lamp", style.lamps * 0.35, 2.6, 0.3)]
    things = [(room.rng.uniform(nearest, room.depth - gap), kind)
              for kind, mean, nearest, gap in kinds for _ in range(room.rng.poisson(mean))]
    return things + [(room.depth - 0.2, "extinguisher")] * room.rng.poisson(0.35)


def draw_person(room, x, z, density):
    texture, mask = person(room.rng, density, room.rng.random() < room.style.orange)
    size = room.rng.uniform(0.92, 1.08)
    room.painter.upright(x, room.floor, z, PERSON_WIDTH_M * size, PERSON_HEIGHT_M * size,
                         room.lit(texture), mask)


DRAW = {"desk": furniture.draw_desk, "person": draw_person, "chair": furniture.draw_chair,
        "plant": furniture.draw_plant, "box": furniture.draw_box, "sofa": furniture.draw_sofa,
        "lamp": furniture.draw_standing_lamp, "extinguisher": furniture.draw_extinguisher}
