# SPDX-License-Identifier: Apache-2.0
"""Surfaces and colours: linear reflectances (RGB, float32), made of random fields."""
import functools

import cv2
import numpy as np

F = np.float32
BANK = 1024  # pixels of a random field

WOODS = [(0.42, 0.25, 0.12), (0.52, 0.33, 0.16), (0.30, 0.15, 0.07), (0.60, 0.42, 0.22),
         (0.20, 0.10, 0.05), (0.48, 0.24, 0.09), (0.55, 0.40, 0.26)]


@functools.lru_cache(None)
def _noise_bank(power):
    """A random field whose spectrum falls with the given power, with mean 0 and deviation 1."""
    rng = np.random.default_rng(77)
    fy, fx = np.fft.fftfreq(BANK)[:, None], np.fft.rfftfreq(BANK)[None, :]
    amplitude = 1 / np.maximum(np.hypot(fx, fy), 1 / BANK) ** power
    amplitude[0, 0] = 0
    spectrum = amplitude * np.exp(2j * np.pi * rng.random(amplitude.shape))
    field = np.fft.irfft2(spectrum, (BANK, BANK))
    return (field / field.std()).astype(F)


def noise(rng, h, w, power=1.2, zoom_x=1.0, zoom_y=1.0):
    """A piece of a random field, zoomed."""
    bank = _noise_bank(power)
    rows = int(np.clip(h / zoom_y, 2, BANK))
    columns = int(np.clip(w / zoom_x, 2, BANK))
    y, x = rng.integers(BANK + 1 - rows), rng.integers(BANK + 1 - columns)
    piece = bank[y:y + rows, x:x + columns]
    if rng.random() < 0.5:
        piece = piece[:, ::-1]
    return cv2.resize(np.ascontiguousarray(piece), (w, h), interpolation=cv2.INTER_LINEAR)


def plain(rng, h, w, colour, rough=0.02, patchy=0.04):
    shade = 1 + F(rough) * noise(rng, h, w, 0.3) + F(patchy) * noise(rng, h, w, 1.8)
    return np.maximum(shade, 0.05)[..., None] * np.asarray(colour, F)


def wood(rng, h, w, along_x=True):
    colour = WOODS[rng.integers(len(WOODS))]
    long, wide = (w, h) if along_x else (h, w)
    grain = noise(rng, wide, long, 1.1, zoom_x=14, zoom_y=1.2)
    rings = np.sin(6 * noise(rng, wide, long, 2.0, zoom_x=6, zoom_y=1.5))
    fine = noise(rng, wide, long, 0.2, zoom_x=20)
    shade = 1 + 0.10 * grain + 0.09 * rings + 0.04 * fine
    shade = shade if along_x else shade.T
    shade = np.ascontiguousarray(np.clip(shade, 0.4, 1.5)[..., None].astype(F))
    return np.asarray(colour, F) * shade ** np.array([0.85, 1.0, 1.2], F)


def carpet(rng, h, w, colour):
    shade = 1 + 0.13 * noise(rng, h, w, 0.0) + 0.08 * noise(rng, h, w, 1.3)
    return np.maximum(shade, 0.1)[..., None] * np.asarray(colour, F)


def _rgb_of(hue, saturation, value):
    return cv2.cvtColor(np.array([[[hue, saturation, value]]], F), cv2.COLOR_HSV2RGB)[0, 0]


def any_colour(rng):
    return _rgb_of(rng.uniform(0, 360), rng.uniform(0.2, 0.95), rng.uniform(0.06, 0.6))


def warm_colour(rng):
    return _rgb_of(rng.uniform(0, 42), rng.uniform(0.55, 0.96), rng.uniform(0.15, 0.75))


def rounded(mask):
    """Shading of a thing with this outline, as if bulged: bright inside, dark at the rim."""
    distance = cv2.distanceTransform(mask, cv2.DIST_L2, 3)
    top = max(distance.max(), 1e-3)
    x = np.clip(distance / top, 0, 1)
    return (0.55 + 0.45 * np.sqrt(1 - (1 - x) ** 2)).astype(F)


def bulged_thing(rng, h, w, colour, draw):
    """A texture and mask of a bulged thing whose outline `draw` puts into the mask."""
    mask = np.zeros((h, w), np.uint8)
    draw(mask)
    side = np.linspace(-1, 1, w, dtype=F)[None, :] * F(rng.uniform(-0.2, 0.2))
    texture = plain(rng, h, w, colour) * (rounded(mask) * (1 + side))[..., None]
    return texture, mask


def of_size(width_m, height_m, density, make):
    """What make(h, w) gives for a surface of this size, with so many pixels per metre."""
    return make(max(4, int(height_m * density)), max(4, int(width_m * density)))
