# SPDX-License-Identifier: Apache-2.0
"""Even light from all sides, a lamp far away, and the blinking LEDs, as a shutter sees them."""
import numpy as np

from camera import HEIGHT
from shapes import dot, moved


class Light:
    def __init__(self, lux=(0, 0, 0), lamp_lux=(0, 0, 0), lamp_from=(0, -1, 0), exposure=0.005,
                 hz=500.0, duty=0.5, phase=0.0, line_delay=0.0):
        self.lux, self.lamp_lux = np.asarray(lux, float), np.asarray(lamp_lux, float)  # RGB
        self.lamp_from = np.asarray(lamp_from, float) / np.linalg.norm(lamp_from)
        self.exposure, self.hz, self.duty, self.phase = exposure, hz, duty, phase
        self.line_delay = line_delay  # seconds by which a row is later than the one above it
        self.middle_row = (HEIGHT - 1) / 2  # whose exposure is about time 0

    def lit(self, t, window):
        """Share of [t - window/2, t + window/2] in which the LEDs shine."""
        def until(x):
            periods = x * self.hz + self.phase
            whole = np.floor(periods)
            return whole * self.duty + np.minimum(periods - whole, self.duty)
        return (until(t + window / 2) - until(t - window / 2)) / (window * self.hz)

    def reflected(self, normal, albedo):
        sky = 0.75 - 0.25 * normal[..., 1]  # the ceiling is brighter than the floor
        lamp = np.maximum(normal @ self.lamp_from, 0)
        return albedo * (sky[..., None] * self.lux + lamp[..., None] * self.lamp_lux) / np.pi


def glow_on_stick(stick, points, times, lit):
    """Light of the spheres on a stick that passes through them: the form factor of a sphere seen
    by a plane that goes through its centre."""
    light = np.zeros(points.shape)
    for ball in stick.lit_by:
        away = points - moved(ball.centre, ball.velocity, times).reshape(-1, 3)
        h = np.maximum(np.sqrt(dot(away, away)) / ball.radius, 1.0001)
        root = np.sqrt(h * h - 1)
        light += (((np.arctan(1 / root) - root / (h * h)) / np.pi) * lit)[:, None] * ball.led
    return stick.albedo * light
