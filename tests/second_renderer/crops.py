#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Enlarges the wands of pictures that judge.py has rendered, side by side in one image."""
import installed_packages  # first: it may end the program

import argparse

import cv2
import numpy as np

from camera import HEIGHT, WIDTH
from conditions import condition_named
from stored_pictures import DEFAULT_FOLDER, StoredPictures

TILE, IN_A_ROW = 500, 4
NO_WAND = [[WIDTH / 4, HEIGHT / 4], [3 * WIDTH / 4, 3 * HEIGHT / 4]]


def tile_of(pictures, index, label):
    image = cv2.imread(pictures.image_path(index))
    wands = pictures.truth(index)["wands"]
    shown = np.array(wands[0]["px"] if wands else NO_WAND)
    middle = shown.mean(0)
    half = max(np.ptp(shown, axis=0).max() / 2 + 35, 60)
    scale = TILE / 2 / half
    tile_from_image = np.array([[scale, 0, TILE / 2 - middle[0] * scale],
                                [0, scale, TILE / 2 - middle[1] * scale]])
    tile = cv2.warpAffine(image, tile_from_image, (TILE, TILE), flags=cv2.INTER_NEAREST)
    tile = (255 * (tile / 255.0) ** 0.6).astype(np.uint8)
    cv2.putText(tile, label, (5, 20), 0, 0.6, (255, 255, 255), 1, cv2.LINE_AA)
    return tile


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", help="image file")
    parser.add_argument("pictures", nargs="+", metavar="CONDITION:INDEX")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cache", default=DEFAULT_FOLDER, metavar="FOLDER")
    args = parser.parse_args()
    tiles = []
    for text in args.pictures:
        name, index = text.split(":")
        pictures = StoredPictures(args.cache, condition_named(name), args.seed)
        tiles.append(tile_of(pictures, int(index), text))
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % IN_A_ROW)
    cv2.imwrite(args.out, np.vstack([np.hstack(tiles[k:k + IN_A_ROW])
                                     for k in range(0, len(tiles), IN_A_ROW)]))


if __name__ == "__main__":
    main()
