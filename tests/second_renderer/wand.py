# SPDX-License-Identifier: Apache-2.0
"""A wand somewhere before the camera, with the hand and arm that hold it."""
import numpy as np

from camera import HEIGHT, WIDTH
from people import SKIN
from shapes import SPHERE_RADIUS_M, WAND_M, Ball, Capsule
from textures import any_colour, warm_colour

STEEPEST = np.sin(np.radians(70))  # towards the camera
STICK_COLOURS = [(0.03, 0.03, 0.03), (0.5, 0.33, 0.18), (0.45, 0.45, 0.46), (0.7, 0.7, 0.7)]
# Radius of what hides a sphere: half of its length.
HIDERS = {0.011: 0.035, 0.035: 0.06, 0.10: 0.2}


def unit_vector(rng):
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


def _normalised(v):
    return v / np.linalg.norm(v)


class Wand:
    """Balls, the other parts, and where the centres of the spheres are in the picture: px at the
    middle of the exposure (of their row), lit_px at the mean time of the LEDs' light in it."""

    def __init__(self, rng, condition, camera, light, down, led_rgb):
        self.points, axis = _place(rng, condition, camera)
        speed = rng.uniform(*condition.speed)
        velocity = unit_vector(rng) * speed
        turn = np.cross(unit_vector(rng) * min(speed, 1.0), axis)  # of the middle sphere, rad/s
        velocity = velocity + (WAND_M - WAND_M[1])[:, None] * turn
        self.balls = [_sphere(rng, condition.uneven, axis, *moving, led_rgb)
                      for moving in zip(self.points, velocity)]
        self.parts, self.shoulder = [], None
        if not condition.clean:
            self.parts, self.shoulder = _stick_and_bearer(rng, self.points, axis, velocity, down)
            self.parts[0].lit_by = self.balls
        if condition.hidden:
            self.parts.append(_hider(rng, self.points, int(rng.integers(3)), axis))
        self.px, self.lit_px = ([_seen_at(camera, light, *moving, lit)
                                 for moving in zip(self.points, velocity)]
                                for lit in (False, True))


def _place(rng, condition, camera):
    """Centres of the spheres, inside the image but for one that the border cuts; and the axis."""
    while True:
        axis = unit_vector(rng)
        if abs(axis[2]) > STEEPEST:
            continue
        z = rng.uniform(*condition.distance)
        end = 1
        if condition.cut:
            end = int(rng.choice([0, 2]))
            u, v = _place_at_border(rng, SPHERE_RADIUS_M * camera.focal_px / z)
        else:
            u, v = rng.uniform(0, WIDTH), rng.uniform(0, HEIGHT)
        x, y = camera.rays(np.float64(u), np.float64(v))
        points = np.array([x, y, 1.0]) * z + (WAND_M - WAND_M[end])[:, None] * axis
        if (points[:, 2].min() < 0.7 * condition.distance[0]
                or points[:, 2].max() > 1.15 * condition.distance[1]):
            continue
        p = camera.project(points)
        margin = SPHERE_RADIUS_M * camera.focal_px / points[:, 2] * 1.1 + 4
        is_inside = ((p[:, 0] > margin) & (p[:, 0] < WIDTH - 1 - margin) & (p[:, 1] > margin)
                     & (p[:, 1] < HEIGHT - 1 - margin))
        is_inside[end] |= condition.cut
        if is_inside.all():
            return points, axis


def _place_at_border(rng, radius_px):
    inside = rng.uniform(-0.75, 0.75) * radius_px
    side = rng.integers(4)
    u, v = rng.uniform(20, WIDTH - 20), rng.uniform(20, HEIGHT - 20)
    return [(inside - 0.5, v), (WIDTH - 0.5 - inside, v), (u, inside - 0.5),
            (u, HEIGHT - 0.5 - inside)][side]


def _sphere(rng, uneven, axis, centre, velocity, led_rgb):
    slope_way = unit_vector(rng) if rng.random() < 0.5 else axis * rng.choice([-1, 1])
    spot = None
    if uneven > 0:
        spot = (unit_vector(rng), rng.uniform(0, uneven), rng.uniform(1, 4))
    return Ball(centre, SPHERE_RADIUS_M, np.full(3, rng.uniform(0.6, 0.8)), velocity,
                led_rgb * (1 + rng.uniform(-uneven, uneven)), rng.uniform(0.05, 0.3),
                slope_way * rng.uniform(0.3, 1.0) * uneven, spot)


def _stick_and_bearer(rng, points, axis, velocity, down):
    """The stick, a hand and an arm; and the shoulder."""
    where = rng.random()
    if where < 0.65:  # held beyond the last sphere
        grip, begin, end = rng.uniform(0.52, 0.66), -0.02, 0.72
    elif where < 0.85:  # before the first
        grip, begin, end = rng.uniform(-0.25, -0.13), -0.32, 0.41
    else:  # between two
        grip, begin, end = rng.uniform(0.23, 0.29), -0.02, 0.41

    def place(s):
        return points[0] + axis * s

    def velocity_at(s):
        return velocity[0] + (velocity[2] - velocity[0]) * s / WAND_M[2]
    colour = np.asarray(STICK_COLOURS[rng.integers(len(STICK_COLOURS))])
    stick = Capsule(place(begin), place(end), rng.uniform(0.002, 0.005), colour,
                    velocity_at(begin), velocity_at(end))
    skin = np.asarray(SKIN[rng.integers(len(SKIN))], float)
    sleeve = np.asarray(any_colour(rng), float)
    hand, palm = _hand(rng, place(grip), velocity_at(grip), axis, skin)
    away = axis if grip > 0.4 else -axis if grip < 0 else np.zeros(3)
    arm, shoulder = _arm(rng, place(grip), palm, velocity_at(grip), away, down, skin, sleeve)
    return [stick] + hand + arm, shoulder


def _hand(rng, grip, velocity, axis, skin):
    """Four fingers and a palm; and the palm's middle."""
    view = grip / np.linalg.norm(grip)
    face = _normalised(-view + axis * (axis @ view))
    across = np.cross(axis, face)
    parts = []
    for along in (-0.03, -0.01, 0.01, 0.03):
        p = grip + axis * along + face * 0.016
        parts.append(Capsule(p + across * 0.022 - face * .012, p - across * 0.018, 0.0095,
                             skin * rng.uniform(0.92, 1.05), velocity, velocity))
    palm = grip - face * 0.028 + across * 0.012
    parts.append(Capsule(palm - axis * 0.025, palm + axis * 0.025, 0.027, skin, velocity, velocity))
    return parts, palm


def _arm(rng, grip, palm, velocity, away, down, skin, sleeve):
    """Forearm and upper arm; and the shoulder."""
    view = grip / np.linalg.norm(grip)
    forearm = 0.6 * away + 0.7 * down + 0.35 * view + 0.35 * unit_vector(rng)
    forearm -= min(0, forearm @ view) * view
    forearm = _normalised(forearm)
    elbow = palm + forearm * 0.05 + forearm * 0.26
    upper = _normalised(0.75 * view - 0.75 * down + 0.5 * forearm + 0.2 * unit_vector(rng))
    shoulder = elbow + 0.27 * upper
    is_bare = rng.random() < 0.35
    return [Capsule(palm, elbow, 0.034, skin if is_bare else sleeve, velocity),
            Capsule(elbow, shoulder, 0.046, sleeve)], shoulder


def _hider(rng, points, number, axis):
    """A thing before a sphere that hides a part of it, and little of the others."""
    centre = points[number]
    is_middle = number == 1
    view = centre / np.linalg.norm(centre)
    others = axis * 0.0 if is_middle else np.delete(points, number, 0).mean(0) - centre
    while True:  # the way from the sphere to the hider, in the picture
        way = unit_vector(rng)
        way -= view * (way @ view)
        way /= np.linalg.norm(way)
        if (way @ others <= 0.25 * np.linalg.norm(others)
                and (not is_middle or abs(way @ axis) < 0.5)):
            break
    along = np.cross(way, view)
    size = float(rng.choice(list(HIDERS)))
    edge = rng.uniform(-0.45, 0.45) * SPHERE_RADIUS_M  # its distance from the sphere's centre
    nearer = 1 - (size + rng.uniform(0.03, 0.25)) / np.linalg.norm(centre)
    middle = (centre + way * edge) * nearer + way * size
    half = min(HIDERS[size], 0.06) if is_middle else HIDERS[size]
    kind = rng.random()
    if size < 0.05 and kind < 0.6:
        colour = SKIN[rng.integers(len(SKIN))]
    else:
        colour = any_colour(rng) if kind < 0.75 else warm_colour(rng)
    return Capsule(middle - along * half, middle + along * half, size, colour)


def _seen_at(camera, light, centre, velocity, lit):
    t = 0.0
    for _ in range(20):  # the row depends on the time, and where the shutter rolls the time on it
        p = camera.project(centre + velocity * t)
        t = (p[1] - light.middle_row) * light.line_delay
        if lit:
            times = t + (np.arange(400) - 199.5) / 400 * light.exposure
            weight = light.lit(times, light.exposure / 400)
            if weight.sum() > 1e-6:
                t = (times * weight).sum() / weight.sum()
    return [float(x) for x in camera.project(centre + velocity * t)]
