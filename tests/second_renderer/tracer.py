# SPDX-License-Identifier: Apache-2.0
"""Ray tracing of the wand and what is near it.

Every ray has a place within its pixel and a time within the exposure, so that edges, motion,
blinking and a rolling shutter are integrated together.
"""
import numpy as np

from light import glow_on_stick
from outline import disc_area
from shapes import Ball

TILE_COLUMNS = 32
ROWS_OF_A_BALL = 300  # in whose delays it may be, at most


def _samples(count):
    """Points (x, y, t) in the unit cube, evenly spread: an additive recurrence with powers of the
    root of g^4 = g + 1. For each point there is one of the same time on the opposite side of the
    pixel, so that the points have no mean offset whichever times have light, and the times are
    evenly spaced."""
    g = 1.22074408460575947536
    n = count // 2
    i = np.arange(1, n + 1)[:, None]
    half = (0.5 + i * np.array([1 / g, 1 / g ** 2, 1 / g ** 3])) % 1.0
    half[:, 2] = (np.argsort(np.argsort(half[:, 2])) + 0.5) / n
    return np.concatenate([half, [[1, 1, 0]] + half * [[-1, -1, 1]]])


def _pixels_near(camera, objects, shape, margin, shutter):
    """Pixels whose rays may meet an object."""
    height, width = shape
    mask = np.zeros(shape, bool)
    for thing in objects:
        for half in (-0.5, 0.5):
            for point, radius in thing.points():
                q = point + thing.velocity * half * shutter
                if q[2] < 0.1:
                    continue
                u, v = camera.project(q)
                reach = 1.12 * (radius + thing.gap()) * camera.focal_px / q[2] + margin
                x0, x1 = int(max(0, np.floor(u - reach))), int(min(width, np.ceil(u + reach) + 1))
                y0, y1 = int(max(0, np.floor(v - reach))), int(min(height, np.ceil(v + reach) + 1))
                if x0 < x1 and y0 < y1:
                    mask[y0:y1, x0:x1] = True
    return mask


def _may_meet(camera, thing, low, high, shutter):
    """Whether rays of the pixels from low to high (row, column) may meet the thing."""
    shift = np.linalg.norm(thing.velocity) * shutter
    for point, radius in thing.points():
        if point[2] < 0.1:
            continue
        gap = thing.gap() * camera.focal_px / point[2]
        u, v = camera.project(point)
        reach = (1.12 * radius + shift) * camera.focal_px / point[2] + 3 + gap
        if low[1] - reach < u < high[1] + reach and low[0] - reach < v < high[0] + reach:
            return True
    return False


class _Sums:
    """What is added up per lit ball."""

    def __init__(self, balls):
        self.balls = balls
        self.seen = np.zeros(len(balls))
        self.led = np.zeros((len(balls), 3))
        self.ambient = np.zeros((len(balls), 3))


def _colour_of(thing, normal, d, distance, t, lit, light, sums, count):
    """Radiance of the points of a thing that rays meet, and the number of the lit ball, or -1."""
    ambient = light.reflected(normal, thing.albedo)
    if thing in sums.balls:
        number = sums.balls.index(thing)
        led = (thing.glow(normal, d) * lit)[:, None] * thing.led
        sums.led[number] += led.sum(0) / count
        sums.ambient[number] += ambient.sum(0) / count
        return ambient + led, number
    if getattr(thing, "lit_by", None):
        ambient = ambient + glow_on_stick(thing, distance[:, None] * d, t, lit)
    return ambient, -1


def _trace_pixels(camera, image, part, offsets, objects, light, is_moving, shutter, sums):
    """Traces the rays of some pixels and draws them."""
    count = len(offsets)
    v, u = part[:, :1].astype(float), part[:, 1:].astype(float)
    x, y = camera.rays(u + offsets[:, 0] - 0.5, v + offsets[:, 1] - 0.5)
    d = np.stack([x, y, np.ones_like(x)], -1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    start = (v - light.middle_row) * light.line_delay
    t = start + (offsets[:, 2] - 0.5) * light.exposure
    # What stands still gets the mean light, so that nothing depends on the few times.
    if is_moving:
        lit = light.lit(t, light.exposure * 2 / count)
    else:
        lit = np.broadcast_to(light.lit(start, light.exposure), t.shape)
    low, high = part.min(0), part.max(0)
    nearest = np.full(x.shape, np.inf)
    colour = np.zeros(x.shape + (3,))
    which = np.full(x.shape, -1)
    for thing in objects:
        if not _may_meet(camera, thing, low, high, shutter):
            continue
        distance, normal = thing.hit(d, t)
        first = distance < nearest
        if not first.any():
            continue
        colour[first], which[first] = _colour_of(thing, normal[first], d[first], distance[first],
                                                 t[first], lit[first], light, sums, count)
        nearest = np.where(first, distance, nearest)
    hit = np.isfinite(nearest)
    cover = hit.mean(1)
    mean = (colour * hit[..., None]).mean(1)
    at = (part[:, 0], part[:, 1])
    image[at] = (image[at] * (1 - cover)[:, None] + mean).astype(np.float32)
    for number in range(len(sums.balls)):
        sums.seen[number] += (which == number).mean(1).sum()


def trace(camera, image, objects, light, fine=200, coarse=6):
    """Draws the objects into the radiance image, with `fine` rays for a pixel of a lit ball and
    `coarse` for others. Returns per lit ball its visible share, the sums of its radiance of LED and
    of ambient light, and its area in pixels."""
    height, width = image.shape[:2]
    balls = [o for o in objects if isinstance(o, Ball) and o.led is not None]
    shutter = light.exposure + light.line_delay * ROWS_OF_A_BALL
    is_moving = any(b.velocity.any() for b in balls)
    near = _pixels_near(camera, objects, (height, width), 2, shutter)
    is_ball = _pixels_near(camera, balls, (height, width), 2, shutter)
    sums = _Sums(balls)
    for pixels, rays in ((np.argwhere(near & ~is_ball), coarse), (np.argwhere(is_ball), fine)):
        count = rays // 2 * 2
        step = min(1500, max(1, 60000 // count))
        # In columns of tiles, so that few objects matter to each chunk.
        pixels = pixels[np.lexsort((pixels[:, 0], pixels[:, 1] // TILE_COLUMNS))]
        offsets = _samples(count)
        for begin in range(0, len(pixels), step):
            _trace_pixels(camera, image, pixels[begin:begin + step], offsets, objects, light,
                          is_moving, shutter, sums)
    areas = np.array([disc_area(camera, b) for b in balls])
    return np.clip(sums.seen / np.maximum(areas, 1e-9), 0, 1), sums.led, sums.ambient, areas
