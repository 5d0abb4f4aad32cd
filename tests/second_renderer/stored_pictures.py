# SPDX-License-Identifier: Apache-2.0
"""Pictures are rendered once into FOLDER/VERSION_seedSEED/CONDITION/{png,truth,camera.yaml}."""
import hashlib
import json
import os
import sys
import time

import cv2

import picture
from photographs import find_photographs

HERE = os.path.dirname(os.path.abspath(__file__))
DEFAULT_FOLDER = os.path.normpath(os.path.join(HERE, "..", "..", "build", "second_renderer"))
NOT_RENDERING = ("crops.py", "installed_packages.py", "judge.py", "scoring.py",
                 "stored_pictures.py", "verify.py")


def _version():
    """Another one for another renderer or other photographs: no stale pictures are used."""
    digest = hashlib.sha256()
    for name in sorted(os.listdir(HERE)):
        if name.endswith(".py") and name not in NOT_RENDERING:
            with open(os.path.join(HERE, name), "rb") as file:
                digest.update(file.read())
    for path in find_photographs():
        digest.update(f"{path} {os.path.getsize(path)}".encode())
    return digest.hexdigest()[:10]


class StoredPictures:
    """Those of a condition. Each has a seed of its own (condition, seed, index): more pictures
    extend a folder, whatever was rendered before."""

    def __init__(self, folder, condition, seed):
        self.condition, self.seed = condition, seed
        self.folder = os.path.join(folder, f"{_version()}_seed{seed}", condition.name)
        self.calibration = os.path.join(self.folder, "camera.yaml")

    def image_path(self, index):
        return os.path.join(self.folder, "png", f"{index:05d}.png")

    def _truth_path(self, index):
        return os.path.join(self.folder, "truth", f"{index:05d}.json")

    def truth(self, index):
        with open(self._truth_path(index)) as file:
            return json.load(file)

    def render(self, count):
        """Renders those that are missing."""
        missing = [i for i in range(count) if not os.path.exists(self._truth_path(i))]
        if not missing:
            return
        for path in (self._truth_path(0), self.image_path(0)):
            os.makedirs(os.path.dirname(path), exist_ok=True)
        camera = picture.camera_of(self.condition, self.seed)
        camera.write(self.calibration)
        begin = time.process_time()
        for i in missing:
            image, truth = picture.render(self.condition, camera, self.seed, i)
            cv2.imwrite(self.image_path(i), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            part = self._truth_path(i) + ".part"
            with open(part, "w") as file:
                json.dump(truth, file)
            os.replace(part, self._truth_path(i))
        each = (time.process_time() - begin) / len(missing)
        print(f"{self.condition.name}: {len(missing)} rendered, {each:.2f} CPU s each",
              file=sys.stderr, flush=True)
