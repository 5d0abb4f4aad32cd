# SPDX-License-Identifier: Apache-2.0
"""What a detector found, beside the truth."""
import numpy as np

FOUND_PX, FALSE_PX = 1.0, 3.0
LEAST_LED_OVER_AMBIENT = 0.5  # below, a wand is dim: it does not count as shown lit


class Score:
    """Of one condition. `visible` is the share of a sphere from which on it is to be found, `key`
    says which true centres count."""

    def __init__(self, condition, visible, key):
        self.condition, self.visible_share, self.key = condition, visible, key
        self.wands = self.wands_found = 0  # with three visible spheres
        self.spheres = self.spheres_found = 0
        self.empty = self.empty_false = 0  # pictures without a wand
        self.shown = self.shown_false = 0  # pictures with one
        self.dim = 0
        self.errors, self.nees, self.times_ms = [], [], []
        self.failures = []  # (index, why)
        self.specials = {}  # pictures and false wands, by name

    @property
    def false(self):
        return self.empty_false + self.shown_false

    def add(self, index, truth, markers, time_ms):
        """Of each marker x y cxx cxy cyy, not a number where it was not found."""
        self.times_ms.append(time_ms)
        if truth["wands"]:
            is_false = self._add_shown(index, truth, markers)
        else:
            is_false = bool(np.isfinite(markers).any())
            self.empty += 1
            self.empty_false += is_false
            if is_false:
                self.failures.append((index, "false wand, none shown"))
        if truth["special"]:
            pictures, false = self.specials.get(truth["special"], (0, 0))
            self.specials[truth["special"]] = (pictures + 1, false + is_false)

    def _add_shown(self, index, truth, markers):
        self.shown += 1
        # Of two wands, the one that fits better.
        offs = [markers[:, :2] - np.array(w[self.key]) for w in truth["wands"]]
        off_px = [np.hypot(*off.T) for off in offs]
        best = int(np.argmin([np.nan_to_num(d).max() for d in off_px]))
        wand, off_px = truth["wands"][best], off_px[best]
        is_false = bool((off_px > FALSE_PX).any())
        self.shown_false += is_false
        if is_false:
            self.failures.append((index, f"false wand, off by {np.nanmax(off_px):.1f} px, visible "
                                         f"{wand['visible']}"))
        else:
            self._add_errors(offs[best], markers)
        if wand["led_over_ambient"] < LEAST_LED_OVER_AMBIENT:
            self.dim += 1
        elif not truth["special"]:
            self._add_found(index, truth, wand, off_px, is_false)
        return is_false

    def _add_errors(self, offs, markers):
        for off, (x, _, cxx, cxy, cyy) in zip(offs, markers):
            if np.isfinite(x):
                self.errors.append(off)
                self.nees.append(off @ np.linalg.solve([[cxx, cxy], [cxy, cyy]], off) / 2)

    def _add_found(self, index, truth, wand, off_px, is_false):
        visible = np.array(wand["visible"]) >= self.visible_share
        if visible.sum() < 2:
            return
        found = visible & (off_px <= FOUND_PX)
        self.spheres += int(visible.sum())
        self.spheres_found += int(found.sum())
        if visible.all() and not self.condition.cut and not self.condition.hidden:
            self.wands += 1
            self.wands_found += bool(found.all())
        if found.sum() < visible.sum() and not is_false:
            what = "not found" if np.isnan(off_px).all() else \
                "errors " + ", ".join("-" if np.isnan(d) else f"{d:.2f}" for d in off_px)
            self.failures.append((index, f"{what}; {wand['distance']} m, radius "
                                         f"{wand['radius_px']} px, visible {wand['visible']}, LED/"
                                         f"ambient {wand['led_over_ambient']}, {truth['lux']} lux"))


HEAD = ("condition", "wands %", "spheres %", "false/none", "false/shown", "dim", "rms px",
        "median px", "bias px", "NEES", "ms", "ms worst")


def row(score):
    """A row of the table."""
    def percent(part, whole):
        return f"{100 * part / whole:.1f}" if whole else ""
    errors = [""] * 4
    if score.errors:
        e = np.array(score.errors)
        squares = (e ** 2).sum(1)
        errors = [f"{np.sqrt(squares.mean()):.3f}", f"{np.sqrt(np.median(squares)):.3f}",
                  f"{np.hypot(*e.mean(0)):.3f}", f"{np.mean(score.nees):.2f}"]
    return [score.condition.name, percent(score.wands_found, score.wands),
            percent(score.spheres_found, score.spheres), f"{score.empty_false}/{score.empty}",
            f"{score.shown_false}/{score.shown}", str(score.dim), *errors,
            f"{np.median(score.times_ms):.2f}", f"{max(score.times_ms):.1f}"]
