# SPDX-License-Identifier: Apache-2.0
"""What goes wrong in rigcal, as one exception."""


class RigcalError(Exception):
    """A calibration that cannot be used, or a server that refuses or cannot be reached.

    The text says what failed, with which id, file or camera, and what to do; a server's message
    is in it as the server gave it.

    Attributes:
        code: The gRPC status, such as "NOT_FOUND" or "UNAVAILABLE"; "" where no server was asked.
    """

    def __init__(self, message: str, code: str = ""):
        super().__init__(message)
        self.code = code
