#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Renders pictures (once) and scores what rigcal-detect-probe finds in them; prints a table."""
import installed_packages  # first: it may end the program

import argparse
import os
import subprocess
import sys

import numpy as np

from conditions import CONDITIONS
from photographs import find_photographs
from scoring import HEAD, Score, row
from stored_pictures import DEFAULT_FOLDER, HERE, StoredPictures

DEFAULT_PROGRAM = os.path.normpath(
    os.path.join(HERE, "..", "..", "build", "test", "bin", "rigcal-detect-probe"))
TARGET = "wand:0,0.13,0.39;diameter=0.04"


def detect(program, pictures, exposure_s, count):
    """Per picture the CPU time in ms, and of each marker x y cxx cxy cyy."""
    images = [pictures.image_path(i) for i in range(count)]
    done = subprocess.run([program, "--calibration", pictures.calibration, "--target", TARGET,
                           "--set", f"exposure={exposure_s}", *images], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    lines = done.stdout.splitlines()
    if done.returncode != 0 or len(lines) != count:
        sys.exit(f"{program} failed after {len(lines)} of {count} pictures: {done.stderr}")
    numbers = np.array([[float(word) for word in line.split()] for line in lines])
    return numbers[:, 0], numbers[:, 1:].reshape(count, -1, 5)


def judge(args, condition):
    """The score, or None: only rendered."""
    pictures = StoredPictures(args.cache, condition, args.seed)
    pictures.render(args.pictures)
    if args.render_only:
        return None
    score = Score(condition, args.visible, "lit_px" if args.truth == "lit" else "px")
    times_ms, markers = detect(args.program, pictures, condition.exposure, args.pictures)
    for i in range(args.pictures):
        score.add(i, pictures.truth(i), markers[i], times_ms[i])
    score.failures = [f"{pictures.image_path(i)}: {why}" for i, why in score.failures]
    return score


def parse_arguments():
    names = [c.name for c in CONDITIONS]

    def conditions(text):
        unknown = set(text.split(",")) - set(names)
        if unknown:
            raise argparse.ArgumentTypeError(f"no such condition: {', '.join(sorted(unknown))}; "
                                             f"there are {', '.join(names)}")
        return text.split(",")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default=DEFAULT_PROGRAM,
                        help="rigcal-detect-probe [%(default)s]")
    parser.add_argument("--pictures", type=int, default=60, help="per condition [60]")
    parser.add_argument("--seed", type=int, default=1, help="other pictures for others [1]")
    parser.add_argument("--only", type=conditions, default=names, metavar="CONDITION,...")
    parser.add_argument("--cache", default=DEFAULT_FOLDER, metavar="FOLDER",
                        help="of the pictures [%(default)s]")
    parser.add_argument("--visible", type=float, default=0.8, metavar="SHARE",
                        help="of a sphere, from which on it is to be found [0.8]")
    parser.add_argument("--truth", choices=("middle", "lit"), default="middle",
                        help="centres at mid exposure [default], or at the mean time of the light")
    parser.add_argument("--failures", action="store_true", help="names the pictures that failed")
    parser.add_argument("--render-only", action="store_true")
    parser.add_argument("--demand", type=conditions, default=[], metavar="CONDITION,...",
                        help="fail if a wand of these is not found, or any wand is false")
    return parser.parse_args()


def unmet(scores, demanded):
    """What --demand demands and is not so."""
    for score in scores:
        if score.false:
            yield f"{score.condition.name}: {score.false} false wands"
        if score.condition.name in demanded and (score.wands_found < score.wands
                                                 or score.spheres_found < score.spheres):
            yield (f"{score.condition.name}: {score.wands_found} of {score.wands} wands, "
                   f"{score.spheres_found} of {score.spheres} spheres found")


def main():
    args = parse_arguments()
    if not args.render_only and not os.path.exists(args.program):
        sys.exit(f"{args.program} is missing: build it (cmake --build --preset test --target "
                 "rigcal-detect-probe), or name another with --program")
    scores = []
    if not args.render_only:
        print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD), flush=True)
    for condition in CONDITIONS:
        if condition.name not in args.only:
            continue
        if condition.photographs and not find_photographs():
            print(f"{condition.name}: left out, there are no photographs; install mate-backgrounds "
                  "and opencv-doc", file=sys.stderr)
            continue
        score = judge(args, condition)
        if score:
            scores.append(score)
            print("| " + " | ".join(row(score)) + " |", flush=True)
    for score in scores:
        if score.specials:
            print("\nspecials, false wands: " + ", ".join(
                f"{name} {false} of {pictures}"
                for name, (pictures, false) in sorted(score.specials.items())))
    if args.failures or args.demand:
        print("", *[failure for score in scores for failure in score.failures], sep="\n")
    if args.demand and (faults := list(unmet(scores, args.demand))):
        sys.exit("\n".join(faults))


if __name__ == "__main__":
    main()
