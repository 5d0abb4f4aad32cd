# SPDX-License-Identifier: Apache-2.0
"""A client of rigcal-server."""

import time
from collections.abc import Iterable, Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rigcal.calibration import Calibration
from rigcal.calibration_job import CalibrationJob, fetch_calibration
from rigcal.connection import Service, connect
from rigcal.errors import RigcalError
from rigcal.exports import write_export
from rigcal.identity import UserIdentity, default_address, join_server
from rigcal.live_mirror import LiveMirror
from rigcal.marker_rows import MarkerRows, RowsByCamera, in_order_of_time
from rigcal.session import PATIENCE_S, Session
from rigcal.targets import parse_target
from rigcal.triangulation_stream import TimedPoints, triangulate_stream
from rigcal.v1.live_pb2 import LiveState
from rigcal.v1.session_pb2 import Session as SessionMessage
from rigcal.v1.target_pb2 import Target
from rigcal.v1.triangulation_service_pb2 import TriangulateStart

SESSION_WAIT_S = 30.0  # for a session that captures
_PAGE_SIZE = 500
_CAPTURES = (SessionMessage.STATE_CAPTURING, SessionMessage.STATE_DRAINING)
_FINISHED = SessionMessage.STATE_FINISHED


class Client:
    """Sessions, live state, calibrations, triangulation and exports of one server.

    Every failure of a call is a RigcalError with the server's message. What has no method here is
    in `api`. It may be used by several threads, and as a context manager.
    """

    def __init__(self, address: str | None = None):
        """
        Args:
            address: HOST:PORT of the gRPC port, or "unix:/PATH"; several servers that take turns,
                with commas between: the one that answers now. None: as `rigcal` chooses it:
                $RIGCAL_SERVER, else the server that this user has joined, else a server of this
                user on this PC, else 127.0.0.1:7420.

        Raises:
            RigcalError: It is no address, or this user has no certificate for another PC's server.
        """
        identity = UserIdentity.of_user()
        self._connection = connect(address or default_address(identity), identity)

    @classmethod
    def join(cls, join_string: str, name: str | None = None) -> "Client":
        """Joins a server on another PC, once, as `rigcal login` does; that program must be on the
        PATH. From then on `Client()` finds the server by itself.

        Args:
            join_string: What `rigcal token create --role operator` has printed there.
            name: Of the user. None: made of the user's name and this PC's.
        """
        join_server(join_string, name)
        return cls(UserIdentity.of_user().servers()[0])

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection."""
        self._connection.close()

    @property
    def address(self) -> str:
        """Where the server is."""
        return self._connection.address

    def api(self, service: str) -> Service:
        """All RPCs of a service with their generated messages, such as
        `client.api("camera").ListCameras()`.

        Args:
            service: The SERVICE of proto/rigcal/v1/SERVICE_service.proto.
        """
        return self._connection.service(service)

    def version(self) -> str:
        """Release of the server."""
        return self.api("status").GetStatus().software_version

    def start_session(
        self,
        target: str | Target,
        *,
        id: str = "",
        rig: str = "",
        cameras: Iterable[str] = (),
        title: str = "",
        until_mm: float | None = None,
    ) -> Session:
        """Creates a session and starts it: agents capture from now on.

        Args:
            target: "wand:0,0.13,0.39" and the like, as on the command line, or the message.
            id: Without it the server makes one.
            rig: Without it "rig".
            cameras: Without them all that are connected.
            title: Free text.
            until_mm: It ends by itself when the expected error is below this in 95 % of the waved
                volume, and held-out data agree.
        """
        wanted = parse_target(target) if isinstance(target, str) else target
        goal = {"goal": {"until_mm": until_mm}} if until_mm is not None else {}
        created = self.api("session").CreateSession(
            id=id, rig=rig, title=title, target=wanted, camera_names=list(cameras), **goal
        )
        return Session(self._connection, created.session).start()

    def session(self, id: str) -> Session:
        """One session."""
        return Session(self._connection, self.api("session").GetSession(id=id).session)

    def sessions(self, filter: str = "") -> Iterator[Session]:
        """All sessions, newest first.

        Args:
            filter: As in docs/api.md: 'rig="rig" AND state=FINISHED'.
        """
        for page in self._pages(self.api("session").ListSessions, filter):
            for message in page.sessions:
                yield Session(self._connection, message)

    def observations(self, session: str | Session) -> RowsByCamera:
        """What the cameras of a session saw, by camera, in the order in which it was taken.

        It is a dict; a camera without rows is a RigcalError that names those that have some.
        """
        times: dict[str, list[Any]] = {}
        pixels: dict[str, list[Any]] = {}
        for part in self.api("session").ReadObservations(session_id=_id_of(session)):
            batch = part.batch
            times.setdefault(batch.camera, []).append(np.array(batch.time_ns, dtype=np.int64))
            pixels.setdefault(batch.camera, []).append(_pixels_of(batch))
        rows = {
            camera: MarkerRows(camera, np.concatenate(own), np.concatenate(pixels[camera]))
            for camera, own in times.items()
        }
        return RowsByCamera(_id_of(session), rows)

    def live(self, rig: str = "") -> LiveState:
        """The rig as it is now: cameras, session, expected error, where to wave, alerts."""
        return self.api("live").GetLive(rig=rig).live

    def watch(
        self,
        rig: str = "",
        interval_s: float = 0.25,
        patience_s: float = PATIENCE_S,
        *,
        session_wait_s: float | None = SESSION_WAIT_S,
    ) -> Iterator[LiveState]:
        """The live state now and whenever it has changed, until the rig's session has finished.

        Args:
            rig: Without it "rig".
            interval_s: Between two questions.
            patience_s: How long the server may be away.
            session_wait_s: How long it waits for a session that captures. None: it goes on
                without one, and after one, until the caller stops.

        Raises:
            RigcalError: FAILED_PRECONDITION: for so long no session has captured.
        """
        mirror, service = LiveMirror(), self.api("live")
        began = last_answer = time.monotonic()
        captures = False
        while True:
            try:
                revision = mirror.state.revision
                answer = service.GetLive(rig=rig, since_revision=revision).live
                last_answer = time.monotonic()
                if mirror.merge(answer):
                    copy = LiveState()
                    copy.CopyFrom(mirror.state)
                    yield copy
            except RigcalError as error:
                if error.code != "UNAVAILABLE" or time.monotonic() - last_answer > patience_s:
                    raise
            if session_wait_s is not None:
                state = mirror.state.session.state
                captures = captures or state in _CAPTURES
                if captures and state == _FINISHED:
                    return
                if not captures and time.monotonic() - began > session_wait_s:
                    raise RigcalError(
                        _no_session_text(rig or "rig", mirror.state, session_wait_s),
                        "FAILED_PRECONDITION",
                    )
            time.sleep(interval_s)

    def calibrate(
        self,
        sessions: str | Session | Iterable[str | Session],
        *,
        options: Mapping[str, Any] | None = None,
        reason: str = "",
        notes: str = "",
    ) -> CalibrationJob:
        """Asks for a calibration from finished sessions.

        Args:
            sessions: One or more of one rig.
            options: Fields of rigcal.v1.CalibrationOptions, such as {"sigma_px": 0.3}.
            reason: Why; kept with it.
            notes: Free text, likewise.

        Returns:
            The job: iterate over it for its progress, or call `result`.
        """
        several = [sessions] if isinstance(sessions, (str, Session)) else list(sessions)
        created = self.api("calibration").CreateCalibration(
            session_ids=[_id_of(session) for session in several],
            options=dict(options or {}),
            reason=reason,
            notes=notes,
        )
        return CalibrationJob(self._connection, created.calibration.id)

    def calibration(self, id: str) -> Calibration:
        """The result of a calibration."""
        return fetch_calibration(self.api("calibration"), id)

    def calibrations(self, filter: str = "") -> Iterator[Any]:
        """All calibrations as rigcal.v1.Calibration, newest first, without their cameras.

        Args:
            filter: As in docs/api.md: 'rig="rig" AND state=SUCCEEDED'.
        """
        for page in self._pages(self.api("calibration").ListCalibrations, filter):
            yield from page.calibrations

    def active_calibration(self, rig: str = "rig") -> Calibration:
        """The calibration that the rig goes by."""
        active = self.api("rig").GetRig(name=rig).rig.active_calibration_id
        if not active:
            raise RigcalError(f"rig {rig} has no active calibration", "FAILED_PRECONDITION")
        return self.calibration(active)

    def activate(self, calibration: str | Calibration, *, reason: str = "") -> None:
        """Makes it what its rig goes by from now on."""
        self.api("rig").ActivateCalibration(id=_id_of(calibration), reason=reason)

    def export(
        self,
        calibration: str | Calibration,
        format: str,
        path: str | PathLike[str],
        *,
        force: bool = False,
        **options: Any,
    ) -> list[Path]:
        """Writes a calibration for another program; docs/exports.md lists the formats.

        Args:
            calibration: It, or its id.
            format: "opencv", "json", "colmap", ...
            path: A folder, made where missing; of a format with one file also the file, such as
                "rig/calibration.json".
            force: Replace files that exist.
            options: undistorted, max_error_px and up_axis of rigcal.v1.ExportCalibrationRequest.

        Returns:
            The files written.
        """
        exported = self.api("calibration").ExportCalibration(
            id=_id_of(calibration), format=format, **options
        )
        # As the command line calls it, which is what Calibration.load looks for.
        name = "calibration.json" if format == "json" else exported.file_name
        return write_export(name, exported.content_type, exported.content, Path(path), force)

    def triangulate(
        self,
        rows: Mapping[str, MarkerRows] | Iterable[MarkerRows],
        calibration: str | Calibration,
        *,
        patience_s: float = PATIENCE_S,
        **options: Any,
    ) -> Iterator[TimedPoints]:
        """Points of rows as they come, at least a block of time (0.5 s) later.

        A lost connection is made again, and nothing is missing or twice.

        Args:
            rows: By camera, recorded; or rows as they come, of all cameras about in the order of
                time.
            calibration: It, or its id.
            patience_s: How long the server may be away.
            options: cameras, sigma_px, max_sigmas, diameter_m, block_s and max_delay_s of
                rigcal.v1.TriangulateStart.

        Raises:
            RigcalError: FAILED_PRECONDITION: all rows have come to an end and there is no point,
                with the reason and when each camera has seen a marker.
        """
        used = self.calibration(calibration) if isinstance(calibration, str) else calibration
        start = TriangulateStart(calibration_id=used.id, **options)
        if isinstance(rows, Mapping):
            if not start.cameras:
                start.cameras.extend(rows)
            rows = in_order_of_time(rows, used)
        return triangulate_stream(self.api("triangulation"), start, rows, used, patience_s)

    @staticmethod
    def _pages(method: Any, filter: str) -> Iterator[Any]:
        token = ""
        while True:
            page = method(filter=filter, page_size=_PAGE_SIZE, page_token=token)
            yield page
            token = page.next_page_token
            if not token:
                return


def _no_session_text(rig: str, live: LiveState, waited_s: float) -> str:
    last = f" (the last one, {live.session.id}, does not)" if live.session.id else ""
    return (
        f"no session of rig {rig} captures{last}, and none began within {waited_s:g} s; start one "
        "with start_session, or watch without one: watch(session_wait_s=None)"
    )


def _id_of(named: str | Session | Calibration) -> str:
    return named if isinstance(named, str) else named.id


def _pixels_of(batch: Any) -> np.ndarray:
    """(N, M, 2) of an ObservationBatch; NaN: not seen."""
    count, markers = len(batch.time_ns), batch.marker_count
    pixels = np.stack([batch.x_px, batch.y_px], axis=-1).astype(np.float64)
    if markers <= 32:
        bits = np.array(batch.visible_mask, dtype=np.uint32)[:, None] >> np.arange(markers)
        visible = (bits & 1).astype(bool).ravel()
    else:
        kinds = np.array(batch.centre_kind)
        visible = np.broadcast_to(kinds != 0, (count * markers,))
    pixels[~visible] = np.nan
    return pixels.reshape(count, markers, 2)
