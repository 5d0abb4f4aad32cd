# SPDX-License-Identifier: Apache-2.0
"""A calibrated camera."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigcal.clock import CameraClock
from rigcal.errors import RigcalError
from rigcal.lens import Lens

Array = NDArray[np.float64]


def rotation_of_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """The rotation matrix, (3, 3), of a unit quaternion, scalar first."""
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    if not abs(norm - 1) < 1e-6:
        raise RigcalError("the rotation is not a unit quaternion")
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclass(frozen=True)
class Camera:
    """One camera of a calibration.

    Attributes:
        name: Within the rig.
        width_px, height_px: Size of its images.
        lens: Its intrinsics.
        cam_from_rig: (4, 4): x_in_cam = cam_from_rig @ x_in_rig, metres. `cam`: x right, y down,
            z forward.
        clock: Its clock against rig time. None: the file has no clocks.
        sigma_px: What its marker centres scatter, one sigma of each coordinate.
        intrinsics_refined: The calibration estimated the intrinsics.
    """

    name: str
    width_px: int
    height_px: int
    lens: Lens
    cam_from_rig: Array
    clock: CameraClock | None = None
    sigma_px: float = 0.5
    intrinsics_refined: bool = False

    @property
    def rotation_cam_from_rig(self) -> Array:
        """(3, 3)."""
        return self.cam_from_rig[:3, :3]

    @property
    def rig_from_cam(self) -> Array:
        """(4, 4), the inverse of `cam_from_rig`."""
        inverse = np.eye(4)
        inverse[:3, :3] = self.rotation_cam_from_rig.T
        inverse[:3, 3] = self.position_m
        return inverse

    @property
    def position_m(self) -> Array:
        """The camera's centre in the rig frame, (3,), metres."""
        return -self.rotation_cam_from_rig.T @ self.cam_from_rig[:3, 3]

    def to_camera(self, points_rig: Array) -> Array:
        """Points (N, 3) of the rig frame in the camera's frame."""
        return points_rig @ self.rotation_cam_from_rig.T + self.cam_from_rig[:3, 3]

    def rays(self, pixels: ArrayLike) -> Array:
        """Unit vectors in the rig frame along which pixels look, (..., 2) to (..., 3). NaN: the
        lens has no ray."""
        return self.lens.directions(pixels) @ self.rotation_cam_from_rig
