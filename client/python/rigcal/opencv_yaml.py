# SPDX-License-Identifier: Apache-2.0
"""Reads the YAML files of the export `opencv`, as cv::FileStorage writes them."""

import re

import numpy as np

from rigcal.errors import RigcalError

_MATRIX = re.compile(
    r"rows:\s*(\d+)\s+cols:\s*(\d+)\s+dt:\s*(\w+)\s+data:\s*\[([^\]]*)\]", re.ASCII
)


def parse_opencv_yaml(name: str, text: str) -> dict[str, object]:
    """Values by key: numbers, texts, and matrices as arrays (rows, cols).

    Raises:
        RigcalError: It is no such file; `name` begins the message.
    """
    if not text.startswith("%YAML"):
        raise RigcalError(f"{name} is no file of OpenCV: it does not begin with %YAML")
    values: dict[str, object] = {}
    # A key begins a line; what belongs to it is indented.
    for item in re.split(r"^(?=[A-Za-z_])", text, flags=re.MULTILINE)[1:]:
        key, _, rest = item.partition(":")
        rest = rest.strip()
        if rest.startswith("!!opencv-matrix"):
            values[key] = _matrix(f"{name}: {key}", rest)
        elif rest.startswith("rows:"):
            raise RigcalError(
                f"{name}: {key} has no !!opencv-matrix: "
                "it is not of rigcal calibration export --format opencv"
            )
        else:
            values[key] = _scalar(rest)
    return values


def _matrix(name: str, text: str) -> np.ndarray:
    found = _MATRIX.search(text)
    if not found:
        raise RigcalError(f"{name} is no matrix of OpenCV")
    rows, columns = int(found[1]), int(found[2])
    try:
        numbers = [float(number) for number in found[4].split(",") if number.strip()]
    except ValueError as error:
        raise RigcalError(f"{name}: {error}") from None
    if found[3] not in ("d", "f") or len(numbers) != rows * columns:
        raise RigcalError(f"{name} is no matrix of {rows} x {columns} real numbers")
    return np.array(numbers).reshape(rows, columns)


def _scalar(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text.strip('"')
