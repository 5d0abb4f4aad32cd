# SPDX-License-Identifier: Apache-2.0
"""Values of enums as words."""

from typing import Any


def enum_name(enum: Any, value: int, prefix: str) -> str:
    """STATE_FINISHED with the prefix STATE_ as "finished"; of a value of a newer server its
    number."""
    by_number = enum.DESCRIPTOR.values_by_number
    if value not in by_number:
        return str(value)
    return by_number[value].name.removeprefix(prefix).lower()
