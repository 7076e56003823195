#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# A TensorFlow Lite file of 4 kB with every operation the network reader knows: a seed for tflite_fuzz.
#   python3 fuzz/make_small_network.py > small.tflite
import struct
import sys


class Writer:
    """A FlatBuffer, each table and vector behind what points to it."""

    def __init__(self):
        self.bytes = bytearray(8)  # offset of the root, identifier

    def align(self):
        self.bytes += bytes(-len(self.bytes) % 4)

    def place(self, item):
        self.align()
        if isinstance(item, dict):  # a table: field number -> number, or item elsewhere
            count = max(item, default=-1) + 1
            offsets = [4 + 4 * sorted(item).index(i) if i in item else 0 for i in range(count)]
            fields = len(self.bytes)
            self.bytes += struct.pack(f"<{2 + count}H", 4 + 2 * count, 4 + 4 * len(item), *offsets)
            self.align()
            start = len(self.bytes)
            self.bytes += struct.pack("<i", start - fields) + bytes(4 * len(item))
            for number, value in item.items():
                at = start + offsets[number]
                word = value if isinstance(value, int) else self.place(value) - at
                struct.pack_into("<i", self.bytes, at, word)
            return start
        start = len(self.bytes)
        self.bytes += struct.pack("<I", len(item))
        if isinstance(item, bytes):
            self.bytes += item + b"\0"
        elif all(isinstance(value, int) for value in item):
            self.bytes += struct.pack(f"<{len(item)}i", *item)
        else:
            self.bytes += bytes(4 * len(item))
            for i, value in enumerate(item):
                at = start + 4 + 4 * i
                struct.pack_into("<I", self.bytes, at, self.place(value) - at)
        return start


def flex_map(options):
    """A FlexBuffer of small integers and vectors of them; every number is one byte."""
    data = bytearray()
    vectors, keys = {}, {}
    for name, value in options.items():
        if isinstance(value, list):
            data.append(len(value))
            vectors[name] = len(data)
            data += bytes(value)
        keys[name] = len(data)
        data += name.encode() + b"\0"
    data.append(len(options))
    key_list = len(data)
    for name in options:
        data.append(len(data) - keys[name])
    data.append(len(data) - key_list)
    data += bytes([1, len(options)])
    values = len(data)
    for name, value in options.items():
        data.append(len(data) - vectors[name] if isinstance(value, list) else value)
    data += bytes(11 << 2 if isinstance(value, list) else 1 << 2 for value in options.values())
    return bytes(data + bytes([len(data) - values, 9 << 2, 1]))


tensors, buffers, codes, operators = [], [{}], [], []


def tensor(shape, kind=0, data=None):
    if data is not None:
        buffers.append({0: data})
    tensors.append({0: shape, 1: kind, 2: len(buffers) - 1 if data is not None else 0})
    return len(tensors) - 1


def constant(shape):
    """Half precision, widened by DEQUANTIZE."""
    size = 1
    for length in shape:
        size *= length
    half = tensor(shape, 1, struct.pack(f"<{size}e", *(0.25 * ((7 * i) % 9 - 4) for i in range(size))))
    return step(6, [half], shape)


def integers(*values):
    return tensor([len(values)], 2, struct.pack(f"<{len(values)}i", *values))


def step(code, inputs, shape, options=None, custom=None):
    entry = {0: code, 2: 2 if custom else 1, 3: code} | ({1: custom[0]} if custom else {})
    if entry not in codes:
        codes.append(entry)
    output = tensor(shape)
    operators.append({0: codes.index(entry), 1: inputs, 2: [output]}
                     | ({4: options} if options else {}) | ({5: custom[1]} if custom else {}))
    return output


image = tensor([1, 8, 8, 3])
same, valid = 0, 1
map_a = step(3, [image, constant([4, 3, 3, 3]), constant([4])], [1, 4, 4, 4], {0: same, 1: 2, 2: 2})  # CONV_2D
map_a = step(54, [map_a, constant([1, 1, 4])], [1, 4, 4, 4])  # PRELU
map_b = step(4, [map_a, constant([1, 3, 3, 4]), constant([4])], [1, 4, 4, 4], {0: same, 1: 1, 2: 1, 3: 1})  # DEPTHWISE
map_c = step(19, [step(0, [map_a, map_b], [1, 4, 4, 4])], [1, 4, 4, 4])  # ADD, RELU
pooled = step(17, [map_c], [1, 2, 2, 4], {0: valid, 1: 2, 2: 2, 3: 2, 4: 2})  # MAX_POOL
padded = step(34, [pooled, integers(0, 0, 1, 0, 0, 1, 0, 2)], [1, 3, 3, 6])  # PAD
large = step(23, [padded, integers(6, 6)], [1, 6, 6, 6], {3: 1})  # RESIZE_BILINEAR
flat = step(22, [pooled], [1, 16])  # RESHAPE
both = step(2, [flat, step(22, [map_c], [1, 64])], [1, 80], {0: 1})  # CONCATENATION
points = step(22, [step(45, [flat, integers(0, 0), integers(1, 16), integers(1, 1)], [1, 16]), ], [1, 8, 2])
scaled = step(18, [points, constant([1])], [1, 8, 2])  # MUL
mesh = step(3, [pooled, constant([12, 2, 2, 4]), constant([12])], [1, 1, 1, 12], {0: valid, 1: 1, 2: 1})
mesh = step(22, [mesh], [1, 4, 3])
matrix = step(32, [mesh], [1, 4, 4], custom=(b"Landmarks2TransformMatrix", flex_map(
    {"left_rotation_idx": 0, "output_height": 4, "output_width": 5, "right_rotation_idx": 1, "scale_x": 2, "scale_y": 2,
     "subset_idxs": [0, 1, 2, 3], "target_rotation_radians": 0})))
region = step(32, [large, matrix], [1, 4, 5, 6], custom=(b"TransformTensorBilinear", flex_map(
    {"output_height": 4, "output_width": 5})))
moved = step(32, [scaled, matrix], [1, 8, 2], custom=(b"TransformLandmarks", flex_map({"version": 2})))

writer = Writer()
root = writer.place({0: 3, 1: codes, 2: [{0: tensors, 1: [image], 2: [both, region, moved, mesh], 3: operators}],
                     4: buffers})
writer.bytes[:8] = struct.pack("<I", root) + b"TFL3"
sys.stdout.buffer.write(writer.bytes)
