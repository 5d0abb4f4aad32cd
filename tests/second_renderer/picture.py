# SPDX-License-Identifier: Apache-2.0
"""One picture of a condition, with its ground truth."""
import zlib

import cv2
import numpy as np

from camera import HEIGHT, WIDTH, Camera
from conditions import Condition
from light import Light
from painter import rotation
from people import PERSON_HEIGHT_M, PERSON_WIDTH_M, person
from photographs import photograph_as_room
from room import draw_room
from sensor import expose
from shapes import SPHERE_RADIUS_M
from tracer import trace
from wand import Wand, unit_vector

F = np.float32
SPECIALS = ("white", "orange", "noise", "screen", "two")
SHARE_LIT = 0.5  # of the time


def _seeded(*parts):
    return np.random.default_rng([zlib.crc32(p.encode()) if isinstance(p, str) else p
                                  for p in parts])


def camera_of(condition, seed):
    return Camera(_seeded("camera", condition.name, seed))


def render(condition, camera, seed, index):
    """Returns the picture of 8 bits and its truth, the same for the same arguments."""
    rng = _seeded("picture", condition.name, seed, index)
    lux = rng.uniform(*condition.lux)
    led_rgb = _led_colour(rng, rng.uniform(*condition.led))
    gain = rng.uniform(*condition.grey) / (led_rgb[0] * SHARE_LIT)
    sensor = _sensor_options(rng, condition)
    special = SPECIALS[index % len(SPECIALS)] if condition.special else None
    truth = {"wands": [], "special": special, "lux": round(float(lux), 1)}
    if special in ("white", "orange", "noise"):
        return expose(rng, _filled(rng, special), 1.0, **sensor), truth
    scene = _Scene(rng, condition, camera, lux)
    light = _light_in(rng, condition, scene, lux)
    down = scene.camera_from_world @ [0, 1, 0]
    if special == "screen":
        _draw_screen_with_wand(rng, camera, scene.room.painter, led_rgb)
    wands = [Wand(rng, condition, camera, light, down, led_rgb)
             for _ in range(_wands_in(condition, special, index))]
    for wand in wands:
        if scene.room and wand.shoulder is not None and rng.random() < condition.person:
            _draw_bearer(rng, scene.room, wand)
    if wands:
        truth["wands"] = _draw_wands(camera, scene.image, wands, light)
    if rng.random() < condition.gain_reduced:
        brightest = led_rgb[0] * SHARE_LIT + 0.7 * (light.lux[0] * 0.9 + light.lamp_lux[0]) / np.pi
        gain = min(gain, 200 / brightest)
    return expose(rng, scene.image, gain, **sensor), truth


def _wands_in(condition, special, index):
    if special:
        return 2 if special == "two" else 0
    return {"always": 1, "mostly": int(index % 3 != 2), "never": 0}[condition.shown]


def _led_colour(rng, luminance):
    hue, saturation = rng.uniform(6, 36), rng.uniform(0.75, 0.97)
    rgb = np.array([1.0, 1 - saturation * (1 - hue / 60), 1 - saturation])
    return rgb * luminance / (rgb @ [0.2126, 0.7152, 0.0722])


def _sensor_options(rng, condition):
    options = dict(blur=rng.uniform(*condition.blur), black=rng.uniform(3, 9),
                   read_noise=rng.uniform(*condition.read_noise),
                   electrons_per_grey=rng.uniform(25, 60), gamma=condition.gamma)
    if condition.disc:
        options["disc"] = rng.uniform(*condition.disc)
    if condition.jpeg:
        options["jpeg"] = int(rng.integers(*condition.jpeg))
    if condition.clean:
        options.update(mosaic=False, noise=False, glare=0.0, vignetting=0.0)
    return options


def _filled(rng, special):
    """A picture that is all white, all orange, or noise."""
    image = np.ones((HEIGHT, WIDTH, 3), F)
    if special == "white":
        return image * rng.uniform(180, 400)
    if special == "orange":
        return image * (np.array([1, rng.uniform(0.2, 0.5), 0.08], F) * F(rng.uniform(120, 250)))
    return (rng.random((HEIGHT, WIDTH, 3), F) ** 2 * F(500)).astype(F)


class _Scene:
    """What is behind the wand: nothing, a photograph or a room."""

    def __init__(self, rng, condition, camera, lux):
        self.room = None
        if condition.clean:
            self.image = np.zeros((HEIGHT, WIDTH, 3), F)
            self.camera_from_world, self.white = np.eye(3), np.zeros(3)
        elif condition.photographs:
            self.image = photograph_as_room(rng, HEIGHT, WIDTH, lux)
            self.camera_from_world, self.white = rotation(0, 0.05, 0), np.full(3, lux / np.pi)
        else:
            self.room = draw_room(rng, camera, condition.style, lux)
            self.image, self.white = self.room.painter.image, self.room.white
            self.camera_from_world = self.room.painter.camera_from_world


def _light_in(rng, condition, scene, lux):
    tint = scene.white / max(scene.white[1], 1e-9)
    if condition.lamp_lux:
        lamp_lux = rng.uniform(*condition.lamp_lux)
    else:
        lamp_lux = lux * rng.uniform(*condition.lamp)
    lamp_from = scene.camera_from_world @ (np.array([0, -1, 0]) + 0.35 * unit_vector(rng))
    return Light(lux * rng.uniform(0.4, 0.9) * tint, lamp_lux * tint, lamp_from,
                 condition.exposure, duty=SHARE_LIT, phase=rng.random(),
                 line_delay=condition.line_delay)


def _draw_wands(camera, image, wands, light):
    """Returns what is to be known about them."""
    objects = [b for w in wands for b in w.balls] + [p for w in wands for p in w.parts]
    largest_px = max(SPHERE_RADIUS_M * camera.focal_px / w.points[:, 2].min() for w in wands)
    rays = 256 if largest_px < 16 else 144
    seen, led, ambient, areas = trace(camera, image, objects, light, rays)
    truths = []
    for k, wand in enumerate(wands):
        part = slice(3 * k, 3 * k + 3)
        ratio = led[part, 0].sum() / max(ambient[part, 0].sum(), 1e-9)
        truths.append({
            "px": wand.px, "lit_px": wand.lit_px,
            "visible": [round(float(s), 4) for s in seen[part]],
            "led_over_ambient": round(float(min(ratio, 999)), 3),
            "distance": round(float(wand.points[1, 2]), 3),
            "radius_px": [round(float(np.sqrt(a / np.pi)), 2) for a in areas[part]]})
    return truths


def _draw_bearer(rng, room, wand):
    """The person whose arm it is, behind the wand."""
    painter = room.painter
    world_from_camera = painter.camera_from_world.T
    shoulder = world_from_camera @ wand.shoulder
    z = max(shoulder[2], (world_from_camera @ wand.points.T)[2].max()) + 0.12
    shoulder = shoulder * z / shoulder[2]
    density = painter.density((shoulder[0], shoulder[1], z))
    texture, mask = person(rng, density, rng.random() < 0.15)
    side = rng.choice([-1, 1])
    painter.upright(shoulder[0] + 0.19 * side, shoulder[1] + 1.40, z, PERSON_WIDTH_M,
                    PERSON_HEIGHT_M, (texture * room.white).astype(F), mask)


def _draw_screen_with_wand(rng, camera, painter, led_rgb):
    """A large screen that shows a picture of the wand."""
    picture = np.full((HEIGHT, WIDTH, 3), 4.0, F)
    light = Light((20, 20, 20))
    wand = Wand(rng, Condition("on the screen", distance=(0.9, 1.6)), camera, light,
                np.array([0, 1.0, 0]), led_rgb)
    trace(camera, picture, wand.balls + wand.parts, light, 49)
    picture = np.clip(picture / led_rgb[0] * 1.8, 0, 1) * F(rng.uniform(150, 350))
    z = rng.uniform(1.4, 2.5)
    width = rng.uniform(0.6, 1.2)
    x, y = rng.uniform(-0.3, 0.3, 2) * z
    small = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    bezel = np.full((8, 8, 3), 1.0, F)
    painter.quad((x - 0.02, y - 0.02, z), (width + 0.04, 0, 0), (0, 0.8 * width + 0.04, 0), bezel)
    painter.quad((x, y, z - 0.002), (width, 0, 0), (0, 0.8 * width, 0), small)
