# SPDX-License-Identifier: Apache-2.0
"""Standing people, as flat cut-outs with shading."""
import cv2
import numpy as np

from textures import any_colour, noise, rounded

F = np.float32

PERSON_WIDTH_M, PERSON_HEIGHT_M = 0.8, 1.8

SKIN = [(0.55, 0.33, 0.23), (0.62, 0.40, 0.30), (0.35, 0.19, 0.12), (0.20, 0.10, 0.06),
        (0.48, 0.28, 0.18)]
ORANGE = [(0.80, 0.20, 0.02), (0.75, 0.28, 0.04), (0.70, 0.12, 0.04), (0.85, 0.33, 0.05)]
TROUSERS = [(0.05, 0.07, 0.14), (0.04, 0.04, 0.04), (0.2, 0.17, 0.12)]
HAIR = [(0.03, 0.02, 0.015), (0.12, 0.06, 0.03), (0.35, 0.22, 0.1), (0.3, 0.3, 0.3),
        (0.3, 0.08, 0.02)]


def one_of(rng, colours):
    return np.asarray(colours[rng.integers(len(colours))], F)


class _CutOut:
    """A texture and its mask, drawn part by part. Places are metres from the top, and from the
    middle to the right."""

    def __init__(self, rng, density):
        self.rng = rng
        self.density = density
        self.h = max(24, int(PERSON_HEIGHT_M * density))
        self.w = max(12, int(PERSON_WIDTH_M * density))
        self.texture = np.zeros((self.h, self.w, 3), F)
        self.mask = np.zeros((self.h, self.w), np.uint8)

    def pixel(self, x, y):
        return int((PERSON_WIDTH_M / 2 + x) * self.density), int(y * self.density)

    def length(self, metres, least=1):
        return max(least, int(metres * self.density))

    def _part(self, colour, draw, folds):
        part = np.zeros((self.h, self.w), np.uint8)
        draw(part)
        inside = part > 127
        shade = rounded(part)
        if folds:
            shade = shade * (1 + F(folds) * noise(self.rng, self.h, self.w, 1.5, zoom_x=0.7,
                                                  zoom_y=1.5))
        self.texture[inside] = (np.maximum(shade, 0.08)[..., None] * colour)[inside]
        self.mask[inside] = 255

    def limb(self, colour, begin, end, width, folds=0.0):
        self._part(colour, lambda m: cv2.line(m, begin, end, 255, self.length(width, 2)), folds)

    def ellipse(self, colour, centre, radius_x, radius_y, folds=0.0):
        size = (int(radius_x * self.density), int(radius_y * self.density))
        self._part(colour, lambda m: cv2.ellipse(m, centre, size, 0, 0, 360, 255, -1), folds)

    def disc(self, colour, centre, radius):
        self._part(colour, lambda m: cv2.circle(m, centre, self.length(radius), 255, -1), 0)

    def polygon(self, colour, corners, folds):
        points = np.array([self.pixel(x, y) for x, y in corners])
        self._part(colour, lambda m: cv2.fillPoly(m, [points], 255), folds)


def person(rng, density, orange=False):
    """Texture and mask of a person; density is in pixels per metre."""
    skin = one_of(rng, SKIN)
    top = one_of(rng, ORANGE) if orange else np.asarray(any_colour(rng), F)
    legs = one_of(rng, ORANGE if orange and rng.random() < 0.3 else TROUSERS)
    body = _CutOut(rng, density)
    _draw_legs(rng, body, legs)
    body.limb(skin, body.pixel(0, 0.2), body.pixel(0, 0.36), 0.11)
    body.polygon(top, [(-0.07, 0.30), (-0.22, 0.38), (-0.18, 0.7), (-0.19, 1.02), (0.19, 1.02),
                       (0.18, 0.7), (0.22, 0.38), (0.07, 0.30)], 0.18)
    _draw_arms(rng, body, top, skin)
    if orange and rng.random() < 0.6:
        _draw_reflecting_stripes(body)
    body.ellipse(one_of(rng, HAIR), body.pixel(0, 0.125), 0.088, 0.115, 0.1)
    body.ellipse(skin, body.pixel(0, 0.155), 0.072, 0.098)
    if density > 120:
        _draw_face(body)
    return body.texture, body.mask


def _draw_legs(rng, body, colour):
    swing = rng.uniform(-0.05, 0.05)
    for side in (-1, 1):
        body.limb(colour, body.pixel(side * 0.09, 0.95), body.pixel(side * 0.11 + swing, 1.68),
                  0.155, 0.16)
        body.ellipse(np.full(3, 0.05, F), body.pixel(side * 0.13 + swing, 1.75), 0.09, 0.045)


def _draw_arms(rng, body, top, skin):
    for side in (-1, 1):
        elbow = body.pixel(side * rng.uniform(0.24, 0.31), 0.68)
        hand = body.pixel(side * rng.uniform(0.12, 0.33), rng.uniform(0.80, 0.98))
        is_bare = rng.random() < 0.4
        body.limb(top, body.pixel(side * 0.20, 0.42), elbow, 0.105, 0.15)
        body.limb(skin if is_bare else top, elbow, hand, 0.08, 0 if is_bare else 0.15)
        body.disc(skin, hand, 0.045)


def _draw_reflecting_stripes(body):
    for y in (0.62, 0.8):
        rows = slice(int(y * body.density), int((y + 0.05) * body.density))
        from_middle = np.abs(np.arange(body.w) / body.density - PERSON_WIDTH_M / 2)
        stripe = (body.mask[rows] > 0) & (from_middle < 0.19)[None, :]
        body.texture[rows][stripe] = np.asarray((0.75, 0.75, 0.65), F)


def _draw_face(body):
    for side in (-1, 1):
        cv2.circle(body.texture, body.pixel(side * 0.03, 0.14), body.length(0.008),
                   (0.03, 0.02, 0.02), -1, cv2.LINE_AA)
    mouth = (int(0.025 * body.density), body.length(0.006))
    cv2.ellipse(body.texture, body.pixel(0, 0.205), mouth, 0, 0, 360, (0.3, 0.1, 0.09), -1,
                cv2.LINE_AA)
