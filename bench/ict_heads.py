#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the narrow face of ICT-FaceKit as a safetensors file for bench/cross_model.

usage: ict_heads.py FOLDER OUTPUT     FOLDER holds ict_facekit_q.npz (packed from the model's OBJ files) and
                                      vertex_indices.json

Tensors, in mm, x to the subject's left, y up, z out of the face:
  neutral [V,3]; identity [m,V,3] offsets at one standard deviation; expression [k,V,3]; triangles [T,3] int32;
  landmarks [68] int32, vertices of the ibug points 1 ... 68.
"""
import json
import struct
import sys

import numpy as np

NUM_NARROW_FACE_VERTICES = 6706  # the model's "narrow face area": no ears, no neck, no back of the head


def save_safetensors(path, tensors):
    names = {np.dtype("float32"): "F32", np.dtype("int32"): "I32"}
    header, blobs, offset = {}, [], 0
    for name, array in tensors.items():
        array = np.ascontiguousarray(array)
        header[name] = {"dtype": names[array.dtype], "shape": list(array.shape),
                        "data_offsets": [offset, offset + array.nbytes]}
        blobs.append(array.tobytes())
        offset += array.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + b"".join(blobs))


def main(folder, output):
    data = np.load(folder + "/ict_facekit_q.npz")
    landmarks = json.load(open(folder + "/vertex_indices.json"))["idx_to_landmark_verts"]
    quads = data["quads"]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[quads[:, 3] >= 0][:, [0, 2, 3]]])
    face = slice(0, NUM_NARROW_FACE_VERTICES)
    triangles = triangles[(triangles < NUM_NARROW_FACE_VERTICES).all(axis=1)]
    scale = 10.0 * float(data["offset_scale"])  # cm to mm
    save_safetensors(output, {
        "neutral": (10.0 * data["neutral"][face]).astype("float32"),
        "identity": (scale * data["identity_offsets_q"][:, face]).astype("float32"),
        "expression": (scale * data["expression_offsets_q"][:, face]).astype("float32"),
        "triangles": triangles.astype("int32"),
        "landmarks": np.array(landmarks, "int32"),
    })


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
