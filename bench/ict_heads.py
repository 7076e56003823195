#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
"""Writes ICT-FaceKit as a safetensors file for bench/cross_model and bench/rendered_heads.

usage: ict_heads.py FOLDER OUTPUT     FOLDER holds ict_facekit_q.npz (packed from the model's OBJ files),
                                      vertex_indices.json and ict_material_groups.json

Tensors, in mm, x to the subject's left, y up, z out of the face; of the narrow face:
  neutral [V,3]; identity [m,V,3] offsets at one standard deviation; expression [k,V,3]; triangles [T,3] int32;
  landmarks [68] int32, vertices of the ibug points 1 ... 68.
Of what is seen of the whole head, whose first V vertices are those of the narrow face:
  head_neutral [W,3]; head_identity [m,W,3]; head_triangles [U,3] int32; head_parts [U] int32: 0 the face with ears and
  nostrils, 1 the back of the head with neck and the insides of eyes and mouth, 2 the eyeballs.
"""
import json
import struct
import sys

import numpy as np

NUM_NARROW_FACE_VERTICES = 6706  # the model's "narrow face area": no ears, no neck, no back of the head
HEAD_PARTS = {"M_Face": 0, "M_BackHead": 1, "M_ScleraLeft": 2, "M_ScleraRight": 2}  # without teeth, lashes, tears


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


def triangles_of(quads):
    """The quads' triangles and the quad of each; a quad whose last corner is -1 is a triangle."""
    full = np.flatnonzero(quads[:, 3] >= 0)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[full][:, [0, 2, 3]]])
    return triangles, np.concatenate([np.arange(len(quads)), full])


def part_of_quads(groups, num_quads):
    """-1: not seen."""
    parts = np.full(num_quads, -1)
    for (first, name), end in zip(groups, [first for first, _ in groups[1:]] + [num_quads]):
        parts[first:end] = HEAD_PARTS.get(name.removeprefix("usemtl "), -1)
    return parts


def main(folder, output):
    data = np.load(folder + "/ict_facekit_q.npz")
    landmarks = json.load(open(folder + "/vertex_indices.json"))["idx_to_landmark_verts"]
    groups = json.load(open(folder + "/ict_material_groups.json"))
    triangles, quads = triangles_of(data["quads"])
    parts = part_of_quads(groups, len(data["quads"]))[quads]
    face = slice(0, NUM_NARROW_FACE_VERTICES)
    face_triangles = triangles[(triangles < NUM_NARROW_FACE_VERTICES).all(axis=1)]
    head, head_triangles = np.unique(triangles[parts >= 0], return_inverse=True)
    assert (head[face] == np.arange(NUM_NARROW_FACE_VERTICES)).all()
    neutral = 10.0 * data["neutral"]  # cm to mm
    scale = 10.0 * float(data["offset_scale"])
    identity = scale * data["identity_offsets_q"]
    save_safetensors(output, {
        "neutral": neutral[face].astype("float32"),
        "identity": identity[:, face].astype("float32"),
        "expression": (scale * data["expression_offsets_q"][:, face]).astype("float32"),
        "triangles": face_triangles.astype("int32"),
        "landmarks": np.array(landmarks, "int32"),
        "head_neutral": neutral[head].astype("float32"),
        "head_identity": identity[:, head].astype("float32"),
        "head_triangles": head_triangles.reshape(-1, 3).astype("int32"),
        "head_parts": parts[parts >= 0].astype("int32"),
    })


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
