# SPDX-License-Identifier: Apache-2.0
"""The clock of a camera against the time of its rig."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Nanoseconds = NDArray[np.int64]

_FIXED_POINT_STEPS = 30


def _rounded(values: NDArray[np.float64]) -> Nanoseconds:
    """To the nearest integer, halves away from zero."""
    return np.trunc(values + np.copysign(0.5, values)).astype(np.int64)


@dataclass(frozen=True)
class CameraClock:
    """rig_time = camera_time + offset + rate * (camera_time - epoch) + course(camera_time).

    Attributes:
        offset_s, rate_ppm, epoch_s: Seconds, parts per million, seconds of the camera's clock.
        course_time_ns, course_offset_s: Corners of what is to be added where the clock jumped or
            drifted: straight lines between them, constant before the first and after the last.
            Empty: nothing.
        line_delay_s: Rolling shutter: from one image row to the next, seconds.
        middle_row_px: The row whose time the clock gives.
    """

    offset_s: float = 0.0
    rate_ppm: float = 0.0
    epoch_s: float = 0.0
    course_time_ns: tuple[int, ...] = ()
    course_offset_s: tuple[float, ...] = ()
    line_delay_s: float = 0.0
    middle_row_px: float = 0.0

    def rig_time_ns(
        self, camera_time_ns: Nanoseconds, y_px: NDArray[np.float64] | None = None
    ) -> Nanoseconds:
        """Rig time of moments of this clock; of a rolling shutter with the row `y_px`."""
        camera_s = 1e-9 * camera_time_ns.astype(np.float64)
        correction_s = (
            self.offset_s
            + 1e-6 * self.rate_ppm * (camera_s - self.epoch_s)
            + self._course_s(camera_time_ns)
        )
        return camera_time_ns + _rounded(1e9 * correction_s) + self._line_delay_ns(y_px)

    def camera_time_ns(
        self, rig_time_ns: Nanoseconds, y_px: NDArray[np.float64] | None = None
    ) -> Nanoseconds:
        """The inverse: the first moment of this clock that is not before the rig time."""
        goal = np.atleast_1d(rig_time_ns - self._line_delay_ns(y_px))
        time_ns = goal.copy()
        for _ in range(_FIXED_POINT_STEPS):
            late_ns = self.rig_time_ns(time_ns) - goal
            if not late_ns.any():
                break
            time_ns = time_ns - late_ns
        else:
            rest = np.flatnonzero(late_ns)
            time_ns[rest] = self._bisected(goal[rest])
        return time_ns.reshape(np.broadcast_shapes(rig_time_ns.shape, np.shape(y_px)))

    def _bisected(self, goal: Nanoseconds) -> Nanoseconds:
        """Where the clock jumps; rig time never falls while camera time passes."""
        reach = np.full_like(goal, 1_000_000)
        while True:
            short = (self.rig_time_ns(goal - reach) >= goal) | (
                self.rig_time_ns(goal + reach) < goal
            )
            if not short.any():
                break
            reach[short] *= 2
        low, high = goal - reach, goal + reach
        while (high - low > 1).any():
            middle = low + (high - low) // 2
            reached = self.rig_time_ns(middle) >= goal
            high, low = np.where(reached, middle, high), np.where(reached, low, middle)
        return high

    def _course_s(self, camera_time_ns: Nanoseconds) -> NDArray[np.float64]:
        if not self.course_time_ns:
            return np.zeros(camera_time_ns.shape)
        corners = np.array(self.course_time_ns, dtype=np.int64)
        offsets = np.array(self.course_offset_s, dtype=np.float64)
        after = np.searchsorted(corners, camera_time_ns, side="right")
        first = np.clip(after - 1, 0, len(corners) - 1)
        last = np.clip(after, 0, len(corners) - 1)
        span_ns = np.maximum(corners[last] - corners[first], 1)
        share = (camera_time_ns - corners[first]).astype(np.float64) / span_ns
        return offsets[first] + share * (offsets[last] - offsets[first])

    def _line_delay_ns(self, y_px: NDArray[np.float64] | None) -> Nanoseconds:
        if y_px is None or self.line_delay_s == 0:
            return np.zeros(np.shape(y_px) if y_px is not None else (), dtype=np.int64)
        return _rounded(1e9 * self.line_delay_s * (y_px - self.middle_row_px))
