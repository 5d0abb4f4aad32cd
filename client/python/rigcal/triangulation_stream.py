# SPDX-License-Identifier: Apache-2.0
"""Points in 3-D that a server makes of rows as they come."""

import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from rigcal.calibration import Calibration
from rigcal.connection import Service
from rigcal.errors import RigcalError
from rigcal.marker_rows import MarkerRows
from rigcal.v1.triangulation_service_pb2 import (
    TriangulateCounts,
    TriangulateRequest,
    TriangulateResponse,
    TriangulateRows,
    TriangulateStart,
)

_ROWS_PER_MESSAGE = 4096
_WAITING_MESSAGES = 16  # taken from the caller before the server has read them
_PAUSE_S = 0.2
_LOST = ("UNAVAILABLE", "UNKNOWN", "INTERNAL", "CANCELLED")  # of a connection that broke


@dataclass(frozen=True)
class TimedPoints:
    """Points in the rig frame, by time, then marker.

    Attributes:
        time_ns: (N,), rig time.
        marker: (N,), number in the rows.
        position_m: (N, 3).
        covariance_m2: (N, 3, 3).
        camera_count: (N,), how many cameras each is from.
        error_px: (N,), root mean square reprojection error over these.
    """

    time_ns: NDArray[np.int64]
    marker: NDArray[np.int64]
    position_m: NDArray[np.float64]
    covariance_m2: NDArray[np.float64]
    camera_count: NDArray[np.int64]
    error_px: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time_ns)

    @classmethod
    def joined(cls, parts: Iterable["TimedPoints"]) -> "TimedPoints":
        """All of them in one."""
        whole = list(parts) or [_points_of(TriangulateResponse(), _BEGIN)]
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in whole]) for name in names))


_BEGIN = (-(2**63), -1)


def _points_of(response: TriangulateResponse, after: tuple[int, int]) -> TimedPoints:
    """Those behind a time and marker."""
    points = [point for point in response.points if (point.time_ns, point.marker) > after]
    upper = np.array([list(point.covariance_m2) for point in points]).reshape(-1, 6)
    position = [(p.position_m.x, p.position_m.y, p.position_m.z) for p in points]
    return TimedPoints(
        np.array([point.time_ns for point in points], dtype=np.int64),
        np.array([point.marker for point in points], dtype=np.int64),
        np.array(position, dtype=np.float64).reshape(-1, 3),
        upper[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3),
        np.array([point.camera_count for point in points], dtype=np.int64),
        np.array([point.error_px for point in points], dtype=np.float64),
    )


class _Feed:
    """Takes rows from the caller, and remembers those that may be needed again.

    A thread of its own reads the caller's rows, so that a broken stream takes none with it.
    """

    def __init__(self, rows: Iterable[MarkerRows], calibration: Calibration, context_ns: int):
        self._rows = rows
        self._calibration = calibration
        self._context_ns = context_ns
        self._changed = threading.Condition()
        self._waiting: deque[TriangulateRows] = deque()
        # With the rig time of the last row of each message.
        self._sent: deque[tuple[int, TriangulateRows]] = deque()
        self._round = 0  # counts the streams; requests of an old one end
        self._ended = self._stopped = False
        self._error: Exception | None = None
        # By camera the rig times of the first and the last row with a marker; None: of none.
        self._seen: dict[str, tuple[int, int] | None] = {}
        threading.Thread(target=self._take, name="rigcal rows", daemon=True).start()

    def requests(self, start: TriangulateStart) -> Iterator[TriangulateRequest]:
        """What a new stream sends: first what an earlier one may not have got to."""
        with self._changed:
            self._round += 1
            own, again = self._round, [rows for _, rows in self._sent]
            self._changed.notify_all()
        yield TriangulateRequest(start=start)
        for rows in again:
            yield TriangulateRequest(rows=rows)
        while (rows := self._next(own)) is not None:
            yield TriangulateRequest(rows=rows)

    def forget_before(self, rig_time_ns: int) -> None:
        """Points up to that time have come."""
        with self._changed:
            while self._sent and self._sent[0][0] < rig_time_ns - self._context_ns:
                self._sent.popleft()

    def raise_error(self) -> None:
        """What the caller's rows have raised."""
        if self._error is not None:
            raise self._error

    def raise_no_point(self, counts: TriangulateCounts) -> None:
        """RigcalError: rows were taken, and none of their markers became a point."""
        if not self._seen:
            return
        first = min((span[0] for span in self._seen.values() if span), default=0)
        when = ", of ".join(
            f"{name} from {1e-9 * (span[0] - first):.1f} to {1e-9 * (span[1] - first):.1f} s"
            if span
            else f"{name} no marker"
            for name, span in self._seen.items()
        )
        why = [
            f"{count} {text}"
            for count, text in (
                (counts.alone, "markers were seen by one camera only"),
                (counts.no_ray, "had parallel rays, or none"),
                (counts.disagree, "had cameras that do not agree"),
                (counts.late_rows, "rows came too late"),
            )
            if count
        ]
        raise RigcalError(
            f"there is no point: {', '.join(why) or 'no marker was seen'}. By the clocks of the "
            f"calibration there are rows of {when}. Are the rows of one recording and of this "
            "calibration's cameras, and were no clocks set anew since?",
            "FAILED_PRECONDITION",
        )

    def stop(self) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def _next(self, own: int) -> TriangulateRows | None:
        with self._changed:
            while not self._waiting and not self._ended and self._round == own:
                if self._stopped:
                    return None
                self._changed.wait()
            if self._round != own or self._stopped or not self._waiting:
                return None
            rows = self._waiting.popleft()
            last = self._calibration.rig_time(rows.camera, rows.time_ns[-1])
            self._sent.append((int(last), rows))
            self._changed.notify_all()
            return rows

    def _take(self) -> None:
        try:
            for rows in self._rows:
                self._calibration.camera(rows.camera)
                self._note(rows)
                for begin in range(0, len(rows), _ROWS_PER_MESSAGE):
                    if not self._put(_message_of(rows[begin : begin + _ROWS_PER_MESSAGE])):
                        return
        except Exception as error:  # pylint: disable=broad-except
            self._error = error
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _note(self, rows: MarkerRows) -> None:
        at = np.flatnonzero(np.isfinite(rows.pixels).all(-1).any(-1))
        known = self._seen.get(rows.camera)
        if at.size == 0:
            self._seen[rows.camera] = known
            return
        span = self._calibration.rig_time(rows.camera, rows.time_ns[at[[0, -1]]])
        self._seen[rows.camera] = (known[0] if known else int(span[0]), int(span[1]))

    def _put(self, rows: TriangulateRows) -> bool:
        with self._changed:
            while len(self._waiting) >= _WAITING_MESSAGES and not self._stopped:
                self._changed.wait()
            self._waiting.append(rows)
            self._changed.notify_all()
            return not self._stopped


def _message_of(rows: MarkerRows) -> TriangulateRows:
    pixels = rows.pixels.astype(np.float32)
    return TriangulateRows(
        camera=rows.camera,
        marker_count=pixels.shape[1],
        time_ns=rows.time_ns.tolist(),
        x_px=pixels[:, :, 0].ravel().tolist(),
        y_px=pixels[:, :, 1].ravel().tolist(),
    )


def triangulate_stream(
    service: Service,
    start: TriangulateStart,
    rows: Iterable[MarkerRows],
    calibration: Calibration,
    patience_s: float,
) -> Iterator[TimedPoints]:
    """Points of rows as they come; see Client.triangulate.

    A stream that breaks is opened again, and is sent the rows anew from which no points came;
    points that had come already are left out.

    Raises:
        RigcalError: What the server refuses; UNAVAILABLE: it was away for longer than
            `patience_s`; FAILED_PRECONDITION: no row had a point, and why.
    """
    # What the server may look at around the last point, and rows of cameras that are behind.
    context_s = 2 * (start.max_delay_s or 2) + 2 * (start.block_s or 0.5)
    feed = _Feed(rows, calibration, round(1e9 * context_s))
    after, counts = _BEGIN, TriangulateCounts()
    last_answer = time.monotonic()
    try:
        while True:
            try:
                for response in service.Triangulate(feed.requests(start)):
                    last_answer = time.monotonic()
                    if response.HasField("counts"):
                        counts = response.counts
                    points = _points_of(response, after)
                    if len(points):
                        after = (int(points.time_ns[-1]), int(points.marker[-1]))
                        feed.forget_before(after[0])
                        yield points
                        last_answer = time.monotonic()
                feed.raise_error()
                if after == _BEGIN:
                    feed.raise_no_point(counts)
                return
            except RigcalError as error:
                feed.raise_error()
                if error.code not in _LOST or time.monotonic() - last_answer > patience_s:
                    raise
            time.sleep(_PAUSE_S)
    finally:
        feed.stop()
