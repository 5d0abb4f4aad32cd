# SPDX-License-Identifier: Apache-2.0
"""rigcal: calibrated rigs of cameras, in Python.

Calibration needs NumPy alone. Client asks a rigcal server, and needs grpc and protobuf as well.
"""

from typing import TYPE_CHECKING, Any

from rigcal.calibration import Calibration
from rigcal.camera import Camera
from rigcal.errors import RigcalError
from rigcal.lens import Lens
from rigcal.marker_rows import MarkerRows
from rigcal.triangulation import TriangulatedPoints
from rigcal.version import VERSION

if TYPE_CHECKING:
    from rigcal.calibration_job import CalibrationJob, Progress
    from rigcal.client import Client
    from rigcal.session import Session
    from rigcal.triangulation_stream import TimedPoints

__version__ = VERSION
__all__ = [
    "Calibration",
    "CalibrationJob",
    "Camera",
    "Client",
    "Lens",
    "MarkerRows",
    "Progress",
    "RigcalError",
    "Session",
    "TimedPoints",
    "TriangulatedPoints",
    "__version__",
]

# What needs grpc and protobuf is imported when it is first used.
_OF_CLIENT = {
    "CalibrationJob": "calibration_job",
    "Client": "client",
    "Progress": "calibration_job",
    "Session": "session",
    "TimedPoints": "triangulation_stream",
}


def __getattr__(name: str) -> Any:
    if name not in _OF_CLIENT:
        raise AttributeError(f"module rigcal has no attribute {name}")
    import importlib

    try:
        return getattr(importlib.import_module(f"rigcal.{_OF_CLIENT[name]}"), name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("grpc", "google"):
            raise
        raise ImportError(
            f"rigcal.{name} needs grpc and protobuf (Debian: python3-grpcio, python3-protobuf; "
            f"pip: rigcal[client]): {error}"
        ) from error
