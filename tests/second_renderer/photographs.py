# SPDX-License-Identifier: Apache-2.0
"""Photographs on posters and screens, outside windows, and behind the wand."""
import functools
import os

import cv2
import numpy as np

F = np.float32

# Of mate-backgrounds and opencv-doc alone: figures must not depend on what else is installed. The
# same pictures as tests/accuracy/detection takes: each .jpg file of at least 512 x 384 pixels.
FOLDERS = ("/usr/share/backgrounds/mate", "/usr/share/doc/opencv-doc/examples/data")
LEAST_WIDTH, LEAST_HEIGHT = 512, 384
WIDEST = 1600  # pixels; wider ones are made smaller


@functools.lru_cache(None)
def find_photographs():
    """Paths; the variable RIGCAL_PHOTOGRAPHS names another folder."""
    own = os.environ.get("RIGCAL_PHOTOGRAPHS")
    found = []
    for root in FOLDERS if own is None else (own,):
        for folder, _, names in os.walk(root):
            for name in names:
                path = os.path.join(folder, name)
                if name.endswith(".jpg") and _is_large(path):
                    found.append(path)
    return tuple(sorted(found))


def _is_large(path):
    half = cv2.imread(path, cv2.IMREAD_REDUCED_COLOR_2)
    return (half is not None and 2 * half.shape[1] >= LEAST_WIDTH
            and 2 * half.shape[0] >= LEAST_HEIGHT)


@functools.lru_cache(40)
def _load(path):
    """Linear values as of reflectances, 0..1, RGB."""
    image = cv2.imread(path, cv2.IMREAD_COLOR)
    scale = WIDEST / image.shape[1]
    if scale < 1:
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return (image[..., ::-1].astype(F) / 255) ** F(2.2)


def part_of_photograph(rng, h, w):
    """A part of any photograph, 0..1. There must be some."""
    paths = find_photographs()
    image = _load(paths[rng.integers(len(paths))])
    rows, columns = image.shape[:2]
    scale = min(rows / h, columns / w) * rng.uniform(0.6, 1.0)
    part_h, part_w = max(2, int(h * scale)), max(2, int(w * scale))
    y, x = rng.integers(rows - part_h + 1), rng.integers(columns - part_w + 1)
    piece = image[y:y + part_h, x:x + part_w]
    if rng.random() < 0.5:
        piece = piece[:, ::-1]
    way = cv2.INTER_AREA if scale > 1 else cv2.INTER_CUBIC
    return np.maximum(cv2.resize(np.ascontiguousarray(piece), (w, h), interpolation=way), 0)


def photograph_as_room(rng, h, w, lux):
    """A photograph as if it were the room: luminance in cd/m^2."""
    image = part_of_photograph(rng, h, w)
    image = image * np.clip(0.2 / max(image.mean(), 1e-3), 0.4, 2.0)
    return (image * (lux / np.pi)).astype(F)
