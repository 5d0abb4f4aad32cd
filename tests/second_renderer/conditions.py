# SPDX-License-Identifier: Apache-2.0
"""What is rendered: rooms, light, wands, exposures."""
import dataclasses
import typing

from room import Style

Range = typing.Tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Condition:
    name: str
    style: typing.Optional[Style] = None  # of the room; None: photographs or nothing
    photographs: bool = False      # instead of a room
    clean: bool = False            # no noise, no mosaic, nothing around
    special: bool = False          # each picture another trap
    shown: str = "mostly"          # wands: mostly (two of three pictures), always, never
    distance: Range = (1.5, 4.5)   # m
    speed: Range = (0.0, 0.3)      # m/s
    cut: bool = False              # the border cuts a sphere
    hidden: bool = False           # something hides a part of a sphere
    person: float = 0.5            # share of wands whose bearer is drawn
    led: Range = (250, 700)        # cd/m^2 while lit
    uneven: float = 0.12           # LEDs, within and between the spheres
    lux: Range = (300, 600)
    lamp: Range = (0.2, 0.8)       # light from above, as a share of lux
    lamp_lux: typing.Optional[Range] = None  # or this many lux
    exposure: float = 0.005        # s
    line_delay: float = 0.0        # s
    grey: Range = (130, 220)       # red of a sphere, of the LED alone
    gain_reduced: float = 0.0      # share of pictures with the gain reduced below clipping
    blur: Range = (0.5, 0.7)       # px
    disc: typing.Optional[Range] = None  # radius when out of focus, px
    read_noise: Range = (1.0, 2.6)  # grey levels
    jpeg: typing.Optional[typing.Tuple[int, int]] = None  # quality
    gamma: bool = False            # 1/2.2, as webcams have


DARK = Style(windows=0.0, outside=1.0, lamps=0.0, screens=0.15, people=0.2, indicators=3)
OFFICE = Style(windows=1.3, shelves=1.2, lamps=0.8, people=0.35)
BRIGHT = Style(windows=1.5, shelves=1.0, lamps=1.5, people=0.4, outside=6000.0)
PEOPLE = Style(windows=0.5, shelves=0.6, lamps=0.8, people=2.6, orange=0.85)
DIM = Style(windows=0.3, outside=150.0, lamps=0.3, people=0.2, shelves=1.0)

DARK_ROOM = dict(style=DARK, lux=(1, 15))
CONDITIONS = [
    Condition("dark_clean", clean=True, speed=(0, 0), uneven=0.0, lux=(0, 0), shown="always"),
    Condition("dark", **DARK_ROOM),
    Condition("dark_moving_saturated", **DARK_ROOM, speed=(1.5, 2.5), grey=(320, 700)),
    Condition("dark_uneven", **DARK_ROOM, uneven=0.35),
    Condition("dark_lamp_above", **DARK_ROOM, lamp_lux=(200, 1000)),
    Condition("office", style=OFFICE),
    Condition("bright_office", style=BRIGHT, lux=(700, 1500), led=(350, 800), gain_reduced=0.6),
    Condition("people_orange", style=PEOPLE),
    Condition("near_dim", style=DIM, lux=(25, 100), distance=(0.9, 1.5)),
    Condition("far_office", style=OFFICE, distance=(4.0, 6.0)),
    Condition("office_1ms", style=OFFICE, exposure=0.001, speed=(0.8, 1.2), grey=(90, 160)),
    Condition("dark_cut", **DARK_ROOM, cut=True),
    Condition("office_cut", style=OFFICE, cut=True),
    Condition("dark_hidden", **DARK_ROOM, hidden=True),
    Condition("office_hidden", style=OFFICE, hidden=True),
    Condition("photographs_300", photographs=True, lux=(300, 300)),
    Condition("photographs_800", photographs=True, lux=(800, 800)),
    Condition("office_defocus", style=OFFICE, disc=(2.6, 3.2)),
    Condition("office_rolling_jpeg", style=OFFICE, line_delay=15e-6, speed=(0.5, 1.5),
              jpeg=(75, 92)),
    Condition("office_gamma", style=OFFICE, gamma=True),
    Condition("photographs_alone", photographs=True, lux=(100, 2000), shown="never"),
    Condition("specials", style=OFFICE, special=True),
]


def condition_named(name):
    return next(c for c in CONDITIONS if c.name == name)
