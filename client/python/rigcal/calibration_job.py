# SPDX-License-Identifier: Apache-2.0
"""A calibration that a server makes."""

from collections.abc import Iterator
from dataclasses import dataclass

from rigcal.calibration import Calibration
from rigcal.connection import ServerConnection, Service
from rigcal.enum_names import enum_name
from rigcal.errors import RigcalError
from rigcal.session import PATIENCE_S, watch_with_patience
from rigcal.v1 import calibration_pb2


@dataclass(frozen=True)
class Progress:
    """How far a calibration is.

    Attributes:
        state: "queued", "running", "succeeded", "failed" or "cancelled".
        stage: "reading", "associating", "adjusting", ...; docs/api.md lists them. "done" at
            the end, however it went.
        fraction: Share of the stage that is done, 0 to 1.
    """

    state: str
    stage: str
    fraction: float


class CalibrationJob:
    """A calibration that was asked for. Iterate over it for its progress, or call `result`.

    Attributes:
        id: "c-000001".
    """

    def __init__(self, connection: ServerConnection, calibration_id: str):
        self._service = connection.service("calibration")
        self.id = calibration_id
        self._ended: calibration_pb2.Calibration | None = None

    def __iter__(self) -> Iterator[Progress]:
        """Progress now and after each change, at most 5 times a second, until the end."""
        if self._ended is not None:
            return
        for update in watch_with_patience(
            lambda: self._service.WatchCalibration(id=self.id), PATIENCE_S
        ):
            calibration = update.calibration
            if calibration.state >= calibration_pb2.Calibration.STATE_SUCCEEDED:
                self._ended = calibration
            stage = enum_name(
                calibration_pb2.CalibrationStage, calibration.progress.stage, "CALIBRATION_STAGE_"
            )
            yield Progress(
                enum_name(calibration_pb2.Calibration.State, calibration.state, "STATE_"),
                "done" if self._ended is not None else stage,
                calibration.progress.fraction,
            )

    def result(self) -> Calibration:
        """Waits for the end.

        Raises:
            RigcalError: The calibration failed or was cancelled; the text says why, and what to do.
        """
        for _ in self:
            pass
        ended = self._ended
        if ended is None or ended.state != calibration_pb2.Calibration.STATE_SUCCEEDED:
            if ended is not None and ended.state == calibration_pb2.Calibration.STATE_CANCELLED:
                raise RigcalError(f"calibration {self.id} was cancelled")
            raise RigcalError(f"calibration {self.id} failed: {ended.error if ended else ''}")
        return fetch_calibration(self._service, self.id)

    def cancel(self) -> None:
        """Ends it; `result` then says so."""
        self._service.CancelCalibration(id=self.id)


def fetch_calibration(service: Service, calibration_id: str) -> Calibration:
    """The whole of a calibration, with the covariance of its cameras."""
    exported = service.ExportCalibration(id=calibration_id, format="json")
    return Calibration.from_json(exported.content.decode(), f"calibration {calibration_id}")
