# SPDX-License-Identifier: Apache-2.0
"""Imported first by the programs here: ends them with 77 where Python's packages are missing."""
import sys

try:
    import cv2
    import numpy  # noqa: F401
except ImportError as error:
    print(f"skipped: {error}; install python3-numpy and python3-opencv (Debian), and use "
          "/usr/bin/python3", file=sys.stderr)
    sys.exit(77)

cv2.setNumThreads(1)
