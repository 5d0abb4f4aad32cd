# SPDX-License-Identifier: Apache-2.0
"""Targets as they are written on the command line."""

from rigcal.errors import RigcalError
from rigcal.v1.target_pb2 import Target

_EXAMPLE = "wand:0,0.13,0.39;diameter=0.04;hz=500;tolerance=0.002"


def parse_target(text: str) -> Target:
    """A wand ("wand:0,0.13,0.39;diameter=0.04;hz=500"), "point", or a board
    ("board:checker,9x6,0.04"). The server checks the values.

    Raises:
        RigcalError: It is none of these.
    """
    head, *options = [part.strip() for part in text.split(";")]
    kind, _, rest = head.partition(":")
    try:
        if kind == "wand":
            target = Target(
                kind=Target.KIND_WAND,
                marker_positions_m=[float(number) for number in rest.split(",")],
            )
        elif head == "point":
            target = Target(kind=Target.KIND_POINT, marker_positions_m=[0])
        elif kind == "board" and not options:
            target = Target(kind=Target.KIND_RIGID, board=head)
        else:
            raise ValueError("a wand, a point or a board without options is read here")
        for option in options:
            name, _, value = option.partition("=")
            if name == "diameter":
                target.diameter_m = float(value)
            elif name == "tolerance":
                target.span_tolerance_m = float(value)
            elif name == "hz":
                target.blink_hz.extend(float(number) for number in value.split(","))
            else:
                raise ValueError(f"{name} is no option; diameter, hz and tolerance are")
    except ValueError as error:
        raise RigcalError(
            f"target {text}: {error}; such as {_EXAMPLE}, or a rigcal.v1.target_pb2.Target",
            "INVALID_ARGUMENT",
        ) from None
    return target
