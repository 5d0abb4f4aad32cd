# SPDX-License-Identifier: Apache-2.0
"""Fields of the JSON of a message, checked: protobuf leaves out zeros and writes NaN as text."""

import math
from typing import Any

from rigcal.errors import RigcalError


def part_of(message: Any, key: str, where: str = "") -> dict[str, Any]:
    """The message in a field.

    Raises:
        RigcalError: There is none; the text has `where` and `key`.
    """
    part = message.get(key)
    if not isinstance(part, dict):
        raise RigcalError(f"{where}{key} is {'missing' if part is None else 'no object'}")
    return part


def number_of(message: dict[str, Any], key: str, where: str = "") -> float:
    """A finite number; 0 where the field is missing.

    Raises:
        RigcalError: It is none; the text has `where`, `key` and the value.
    """
    value = message.get(key, 0)
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise RigcalError(f"{where}{key} is {value}, it must be a finite number")
    return number


def numbers_of(message: dict[str, Any], key: str, where: str = "") -> list[float]:
    """A list of finite numbers, empty where the field is missing.

    Raises:
        RigcalError: It is none; the text has `where`, `key` and the number of the entry.
    """
    values = message.get(key) or []
    if not isinstance(values, list):
        raise RigcalError(f"{where}{key} is {values}, it must be a list of numbers")
    return [
        number_of({f"{key}[{i}]": value}, f"{key}[{i}]", where) for i, value in enumerate(values)
    ]


def size_of(message: dict[str, Any], key: str, where: str = "") -> int:
    """A whole number of pixels, 1 or more.

    Raises:
        RigcalError: It is none; the text has `where`, `key` and the value.
    """
    value = number_of(message, key, where)
    if value < 1 or value != int(value):
        raise RigcalError(f"{where}{key} is {value:g}, it must be a whole number, 1 or more")
    return int(value)
