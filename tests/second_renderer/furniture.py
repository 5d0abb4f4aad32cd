# SPDX-License-Identifier: Apache-2.0
"""Things that stand on the floor at (x, z); density is in pixels per metre."""
import cv2
import numpy as np

import desk_top
from textures import any_colour, bulged_thing, of_size, plain, rounded, warm_colour, wood

F = np.float32

CHAIR_COLOURS = [(0.04, 0.04, 0.05), (0.08, 0.1, 0.16), (0.35, 0.06, 0.03), (0.5, 0.2, 0.05),
                 (0.2, 0.2, 0.2)]
POT_COLOURS = [(0.45, 0.17, 0.07), (0.6, 0.6, 0.58), (0.1, 0.1, 0.1)]
SOFA_COLOURS = [(0.5, 0.18, 0.05), (0.3, 0.12, 0.05), (0.2, 0.2, 0.22), (0.1, 0.14, 0.2),
                (0.5, 0.45, 0.35), (0.45, 0.05, 0.04)]
# Left, top, right and bottom of a sofa's parts, as shares of its size.
SOFA_PARTS = ((.08, 0, .5, .6), (.5, 0, .92, .6), (0, .25, .12, .95), (.88, .25, 1, .95),
              (.1, .55, .5, .75), (.5, .55, .9, .75), (.08, .74, .92, .97))
INDICATOR_COLOURS = [(1, 0.05, 0.02), (1, 0.4, 0.05), (0.1, 1, 0.2), (0.2, 0.4, 1)]


def draw_desk(room, x, z, density):
    rng, quad, lit = room.rng, room.painter.quad, room.lit
    width, deep, high = rng.uniform(1.2, 1.9), 0.75, 0.74
    if rng.random() < 0.6:
        top = of_size(width, deep, density, lambda h, w: wood(rng, h, w))
    else:
        top = of_size(width, deep, density, lambda h, w: plain(rng, h, w, (0.7, 0.7, 0.68)))
    surface, left = room.floor - high, x - width / 2
    leg = plain(rng, max(8, int(high * density)), 8, (0.2, 0.2, 0.21))
    for dx in (-width / 2 + 0.05, width / 2 - 0.09):
        quad((x + dx, surface, z + deep), (0.04, 0, 0), (0, high, 0), lit(leg) * F(0.5))
        quad((x + dx, surface, z), (0.04, 0, 0), (0, high, 0), lit(leg))
    quad((left, room.floor - 0.002, z), (width, 0, 0), (0, 0, deep), np.zeros((8, 8, 3), F),
         np.full((8, 8), 90, np.uint8))  # shadow
    quad((left, surface, z), (width, 0, 0), (0, 0, deep), lit(top) * F(1.1))
    quad((left, surface, z), (width, 0, 0), (0, 0.03, 0), lit(top[:8]) * F(0.7))
    desk_top.draw(room, x, surface, z, width, density)


def draw_box(room, x, z, density):
    rng, quad, lit = room.rng, room.painter.quad, room.lit
    width, height = rng.uniform(0.2, 0.6), rng.uniform(0.2, 0.5)
    texture = of_size(width, height, density, lambda h, w: plain(
        rng, h, w, (0.42, 0.28, 0.16) if rng.random() < 0.7 else warm_colour(rng)))
    middle = texture.shape[1] // 2
    texture[:, middle - 2:middle + 3] *= 1.3
    turned = rng.uniform(-0.5, 0.5)
    front = (width * np.cos(turned), 0, width * np.sin(turned))
    side = (-0.7 * width * np.sin(turned), 0, 0.7 * width * np.cos(turned))
    corner = np.array([x - width / 2, room.floor - height, z])
    quad(corner, front, side, lit(texture) * F(1.15))
    quad(corner if turned > 0 else corner + front, side, (0, height, 0), lit(texture) * F(0.6))
    quad(corner, front, (0, height, 0), lit(texture) * F(0.85))


def draw_extinguisher(room, x, z, density):
    h, w = max(8, int(0.5 * density)), max(6, int(0.18 * density))
    texture, mask = bulged_thing(room.rng, h, w, (0.6, 0.03, 0.02), lambda m: cv2.rectangle(
        m, (w // 6, h // 4), (w - w // 6, h - 1), 255, -1))
    texture[:h // 4] = 0.05
    mask[h // 10:h // 4, w // 3:2 * w // 3] = 255
    room.painter.upright(x, room.floor - 0.9, z, 0.18, 0.5, room.lit(texture), mask)


def draw_chair(room, x, z, density):
    h, w = max(20, int(1.1 * density)), max(14, int(0.6 * density))
    colour = CHAIR_COLOURS[room.rng.integers(len(CHAIR_COLOURS))]

    def draw(m):
        cv2.rectangle(m, (int(.15 * w), int(.02 * h)), (int(.85 * w), int(.45 * h)), 255, -1)
        cv2.ellipse(m, (w // 2, int(.52 * h)), (int(.46 * w), int(.07 * h)), 0, 0, 360, 255, -1)
        cv2.line(m, (w // 2, int(.5 * h)), (w // 2, int(.9 * h)), 255, max(2, w // 14))
        for end in (0.1, 0.35, 0.65, 0.9):
            cv2.line(m, (w // 2, int(.88 * h)), (int(end * w), int(.98 * h)), 255, max(2, w // 18))
    texture, mask = bulged_thing(room.rng, h, w, colour, draw)
    room.painter.upright(x, room.floor, z, 0.6, 1.1, room.lit(texture), mask)


def draw_plant(room, x, z, density):
    rng = room.rng
    h, w = max(20, int(1.3 * density)), max(14, int(0.9 * density))
    texture, mask = np.zeros((h, w, 3), F), np.zeros((h, w), np.uint8)
    pot = np.asarray(POT_COLOURS[rng.integers(len(POT_COLOURS))], F)
    for _ in range(int(rng.integers(40, 90))):
        _draw_leaf(rng, texture, mask)
    part = np.zeros_like(mask)
    cv2.fillPoly(part, [np.array([(int(.3 * w), int(.7 * h)), (int(.7 * w), int(.7 * h)),
                                  (int(.63 * w), h - 1), (int(.37 * w), h - 1)])], 255)
    texture[part > 0] = (rounded(part)[..., None] * pot)[part > 0]
    room.painter.upright(x, room.floor, z, 0.9, 1.3, room.lit(texture), mask | part)


def _draw_leaf(rng, texture, mask):
    h, w = mask.shape
    angle = rng.uniform(-np.pi, 0)
    reach = rng.uniform(0.1, 0.42)
    centre = (int(w * (0.5 + reach * np.cos(angle))), int(h * (0.62 + 1.2 * reach * np.sin(angle))))
    green = np.array([rng.uniform(0.04, 0.14), rng.uniform(0.12, 0.3), 0.04]) \
        * rng.uniform(0.4, 1.2)
    size = (max(2, int(rng.uniform(0.05, 0.12) * w)), max(1, int(rng.uniform(0.015, 0.035) * w)))
    turn = float(np.degrees(angle) + rng.uniform(-30, 30))
    cv2.ellipse(texture, centre, size, turn, 0, 360, [float(g) for g in green], -1, cv2.LINE_AA)
    cv2.ellipse(mask, centre, size, turn, 0, 360, 255, -1, cv2.LINE_AA)


def draw_sofa(room, x, z, density):
    rng = room.rng
    h, w = max(20, int(0.85 * density)), max(30, int(1.8 * density))
    colour = np.asarray(SOFA_COLOURS[rng.integers(len(SOFA_COLOURS))], F)
    texture, mask = np.zeros((h, w, 3), F), np.zeros((h, w), np.uint8)
    for left, top, right, bottom in SOFA_PARTS:
        part = np.zeros_like(mask)
        cv2.rectangle(part, (int(left * w) + 1, int(top * h) + 1),
                      (int(right * w) - 2, int(bottom * h)), 255, -1)
        cloth = plain(rng, h, w, colour, 0.05, 0.08) * rounded(part)[..., None]
        texture[part > 0] = cloth[part > 0]
        mask |= part
    for _ in range(rng.poisson(1.5)):  # cushions
        part = np.zeros_like(mask)
        middle = (int(rng.uniform(.2, .8) * w), int(.42 * h))
        cv2.rectangle(part, (middle[0] - h // 5, middle[1] - h // 6),
                      (middle[0] + h // 5, middle[1] + h // 6), 255, -1)
        cloth = plain(rng, h, w, warm_colour(rng) if rng.random() < 0.6 else any_colour(rng)) \
            * rounded(part)[..., None]
        texture[part > 0] = cloth[part > 0]
    room.painter.upright(x, room.floor, z, 1.8, 0.85, room.lit(texture), mask)


def draw_standing_lamp(room, x, z, density):
    """With a shade, warm and bright."""
    rng = room.rng
    h, w = max(20, int(1.6 * density)), max(10, int(0.45 * density))
    texture, mask = np.zeros((h, w, 3), F), np.zeros((h, w), np.uint8)
    cv2.line(mask, (w // 2, h // 5), (w // 2, h - 1), 255, max(2, w // 22))
    texture[mask > 0] = F(0.15) * room.white
    shade = np.zeros_like(mask)
    cv2.fillPoly(shade, [np.array([(int(.28 * w), 1), (int(.72 * w), 1),
                                   (int(.97 * w), int(.2 * h)), (int(.03 * w), int(.2 * h))])],
                 255, cv2.LINE_AA)
    rows, columns = np.mgrid[0:h, 0:w].astype(F)
    shape = np.exp(-((rows / h - 0.1) / 0.09) ** 2 - ((columns / w - 0.5) / 0.45) ** 2)
    warm = np.array([1.0, rng.uniform(0.5, 0.75), rng.uniform(0.15, 0.45)], F)
    light = (0.25 + shape)[..., None] * warm * F(rng.uniform(400, 2500))
    texture[shade > 0] = light[shade > 0]
    room.painter.upright(x, room.floor, z, 0.45, 1.6, texture, mask | shade)


def draw_indicators(room):
    """Small lights of devices, anywhere before the back wall."""
    rng = room.rng
    for _ in range(rng.poisson(room.style.indicators)):
        texture = np.zeros((16, 16, 3), F)
        mask = np.zeros((16, 16), np.uint8)
        cv2.circle(mask, (8, 8), 6, 255, -1, cv2.LINE_AA)
        texture[:] = np.array(INDICATOR_COLOURS[rng.integers(len(INDICATOR_COLOURS))], F) \
            * F(rng.uniform(20, 400))
        size = rng.uniform(0.004, 0.015)
        room.painter.upright(rng.uniform(room.left, room.right),
                             rng.uniform(room.top + 0.5, room.floor - 0.1), room.depth - 0.4,
                             size, size, texture, mask)
