#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the head poses of AFLW2000-3D's .mat files as CSV for bench/photo_accuracy.

usage: aflw2000_angles.py FOLDER OUTPUT

Lines "stem,pitch,yaw,roll" in degrees, in the data set's own angles (Pose_Para).
"""
import pathlib
import sys

import numpy as np
import scipy.io


def main(folder, output):
    with open(output, "w") as file:
        file.write("stem,pitch,yaw,roll\n")
        for path in sorted(pathlib.Path(folder).glob("*.mat")):
            angles = np.degrees(scipy.io.loadmat(path)["Pose_Para"][0, :3])
            file.write(path.stem + "".join(f",{angle:.4f}" for angle in angles) + "\n")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
