# SPDX-License-Identifier: Apache-2.0
"""Labelled rows: what a camera sees of the markers, moment by moment."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigcal.array_shapes import as_nanoseconds, as_rows
from rigcal.calibration import Calibration
from rigcal.errors import RigcalError

_PIECE_NS = 250_000_000


@dataclass(frozen=True)
class MarkerRows:
    """Rows of one camera.

    Attributes:
        camera: Its name.
        time_ns: (N,), the camera's own clock, ascending.
        pixels: (N, M, 2), the centres of M markers; NaN: not seen.
    """

    camera: str
    time_ns: NDArray[np.int64]
    pixels: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_ns", as_nanoseconds("time_ns", self.time_ns))
        object.__setattr__(self, "pixels", as_rows("pixels", self.pixels, 2))
        if self.time_ns.ndim != 1 or self.pixels.ndim != 3 or len(self.pixels) != len(self.time_ns):
            differ = self.time_ns.ndim == 1 and self.pixels.ndim == 3
            raise ValueError(
                f"rows of {self.camera}: pixels must be (N, M, 2) with as many rows as time_ns, "
                f"got {self.pixels.shape} and {self.time_ns.shape}"
                + (": axis 0 of both must have one length" if differ else "")
            )

    def __len__(self) -> int:
        return len(self.time_ns)

    def __getitem__(self, rows: slice) -> "MarkerRows":
        return MarkerRows(self.camera, self.time_ns[rows], self.pixels[rows])


class RowsByCamera(dict[str, MarkerRows]):
    """The rows of a session, by camera.

    A camera without rows is a RigcalError that names those that have some.
    """

    def __init__(self, session: str, rows: Mapping[str, MarkerRows]):
        super().__init__(rows)
        self._session = session

    def __missing__(self, camera: str) -> MarkerRows:
        raise RigcalError(
            f"session {self._session} has no rows of camera {camera}; it has rows of "
            + (", ".join(self) or "none"),
            "NOT_FOUND",
        )


def in_order_of_time(
    rows: Mapping[str, MarkerRows], calibration: Calibration
) -> Iterator[MarkerRows]:
    """The rows of all cameras in pieces of a quarter of a second, in the order of rig time."""
    times = {
        name: calibration.rig_time(name, own.time_ns) for name, own in rows.items() if len(own)
    }
    if not times:
        return
    first = min(time[0] for time in times.values())
    pieces = {name: (time - first) // _PIECE_NS for name, time in times.items()}
    for number in np.unique(np.concatenate(list(pieces.values()))):
        for name, own in pieces.items():
            begin, end = np.searchsorted(own, [number, number + 1])
            if begin < end:
                yield rows[name][begin:end]
