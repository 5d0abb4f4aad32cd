# SPDX-License-Identifier: Apache-2.0
"""rigcal: calibrated rigs of cameras, in Python.

Calibration needs NumPy alone. Client asks a rigcal server, and needs grpc and protobuf as well.
"""

from rigcal.calibration import Calibration
from rigcal.camera import Camera
from rigcal.errors import RigcalError
from rigcal.lens import Lens
from rigcal.triangulation import TriangulatedPoints
from rigcal.version import VERSION

__version__ = VERSION
__all__ = [
    "Calibration",
    "Camera",
    "Lens",
    "RigcalError",
    "TriangulatedPoints",
    "__version__",
]
