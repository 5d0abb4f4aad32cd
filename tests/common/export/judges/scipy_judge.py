# SPDX-License-Identifier: Apache-2.0
# python3 scipy_judge.py FOLDER
# Reads FOLDER/rig.mat with SciPy and prints where OpenCV shows the points of FOLDER/points.txt.
import sys

import cv2
import numpy as np
import scipy.io

folder = sys.argv[1]
points = [line.split() for line in open(folder + "/points.txt")]
for camera in scipy.io.loadmat(folder + "/rig.mat", squeeze_me=True)["cameras"]:
    x = np.array([[float(v) for v in p[1:]] for p in points if p[0] == camera["name"]])
    lens = [np.ascontiguousarray(camera[k], dtype=float) for k in ("K", "DistortionCoefficients")]
    rotation = np.ascontiguousarray(cv2.Rodrigues(np.ascontiguousarray(camera["R"]))[0])
    translation = np.ascontiguousarray(camera["t"], dtype=float).reshape(3, 1)
    fisheye = camera["DistortionModel"] == "equidistant"
    project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    pixels = project(x.reshape(-1, 1, 3), rotation, translation, *lens)[0].reshape(-1, 2)
    for u, v in pixels:
        print("SEEN", camera["name"], u - 1, v - 1)
