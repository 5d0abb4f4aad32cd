# SPDX-License-Identifier: Apache-2.0
"""Sessions: recordings of the waved wand."""

import time
from collections.abc import Callable, Iterator
from typing import Any

from google.protobuf.duration_pb2 import Duration

from rigcal.connection import ServerConnection
from rigcal.enum_names import enum_name
from rigcal.errors import RigcalError
from rigcal.v1 import session_pb2

PATIENCE_S = 30.0  # how long a server may be away before a wait for it is given up
_PAUSE_S = 0.2


class Session:
    """A session of a server, as it was when it was last asked for.

    Attributes:
        message: rigcal.v1.session_pb2.Session.
    """

    def __init__(self, connection: ServerConnection, message: session_pb2.Session):
        self._service = connection.service("session")
        self.message = message

    def __repr__(self) -> str:
        return f"<rigcal.Session {self.id}: {self.state}, {self.observation_count} observations>"

    @property
    def id(self) -> str:
        return self.message.id

    @property
    def state(self) -> str:
        """ "created", "capturing", "draining" or "finished"."""
        return enum_name(session_pb2.Session.State, self.message.state, "STATE_")

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of its cameras; empty until it is started, and in lists."""
        return tuple(camera.description.camera for camera in self.message.cameras)

    @property
    def observation_count(self) -> int:
        """Stored observations of all cameras."""
        return self.message.observation_count

    def refresh(self) -> "Session":
        """Asks the server for it again."""
        self.message = self._service.GetSession(id=self.id).session
        return self

    def start(self) -> "Session":
        """Has every camera of it captured."""
        self.message = self._service.StartSession(id=self.id).session
        return self

    def stop(self, wait: bool = True, drain_timeout_s: float = 10.0) -> "Session":
        """Ends the capture.

        Args:
            wait: Return once all observations are stored.
            drain_timeout_s: How long the server waits for agents; up to 600 s.
        """
        timeout = Duration(nanos=0)
        timeout.FromMilliseconds(round(1000 * drain_timeout_s))
        self.message = self._service.StopSession(id=self.id, drain_timeout=timeout).session
        return self.wait() if wait else self

    def wait(self, patience_s: float = PATIENCE_S) -> "Session":
        """Returns once it has finished, by itself or by `stop`."""
        for _ in self.watch(patience_s):
            pass
        return self

    def watch(self, patience_s: float = PATIENCE_S) -> Iterator["Session"]:
        """Gives itself now and after each change, until it has finished.

        Args:
            patience_s: How long the server may be away.
        """
        for update in watch_with_patience(
            lambda: self._service.WatchSession(id=self.id), patience_s
        ):
            self.message = update.session
            yield self


def watch_with_patience(
    watch: Callable[[], Iterator[Any]], patience_s: float
) -> Iterator[Any]:
    """The messages of a stream to its end; a lost connection is made again.

    Args:
        watch: Opens the stream, which begins with the present state.
        patience_s: How long the server may be away.

    Raises:
        RigcalError: What the server refuses, or UNAVAILABLE after that time.
    """
    last = time.monotonic()
    while True:
        try:
            for message in watch():
                yield message
                last = time.monotonic()
            return
        except RigcalError as error:
            if error.code != "UNAVAILABLE" or time.monotonic() - last > patience_s:
                raise
        time.sleep(_PAUSE_S)
