#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Installs what is missing, builds everything with warnings as errors, and runs all checks and tests:
#   scripts/test.sh [ctest arguments]
source "$(dirname "$0")/lib.sh"

step "install what is missing" install_packages "${build_packages[@]}" "${test_packages[@]}"
if command -v npm > /dev/null; then
    try_step "fetch the glTF validator" fetch_npm_package gltf-validator 2.0.0-dev.3.10 "$cache/npm/node_modules/gltf-validator"
    export LINEAMENT_GLTF_VALIDATOR=$cache/npm/node_modules
    if command -v chromium > /dev/null; then
        try_step "fetch three.js" fetch_npm_package three 0.180.0 "$cache/npm/node_modules/three"
        if [ -e "$cache/npm/node_modules/three/package.json" ]; then
            export LINEAMENT_THREE=$cache/npm/node_modules/three
        fi
    else
        say "== no chromium here: the tests with a browser will be skipped by name"
    fi
    for package in face_detection@0.4.1657300184 face_mesh@0.4.1633559619; do # 12.5 MB; their networks: models/README.md
        try_step "fetch MediaPipe's $package" \
            fetch_npm_package "@mediapipe/${package%@*}" "${package#*@}" "$cache/npm/mediapipe-${package/@/-}"
    done
else
    say "== no npm here: the tests with the glTF validator, three.js and MediaPipe's packages will be skipped by name"
fi
step "check the source tree" "$root/scripts/check-source.sh"
step "configure" configure ci -DLINEAMENT_QUICK_BUILD=ON
step "build, and compile each public header alone" \
    cmake --build "$root/build/ci" -j "$(nproc)" --target all lineament_headers
# Vectors come as macros that depend on the compiler; the build above is clang's.
step "check that GCC takes the kernels too" \
    g++ -std=c++20 -fsyntax-only -I"$root/include" -I"$root/src/kernels" "$root/src/kernels/dispatched_kernels.cpp"
step_name="run the tests"
say "== $step_name"
ctest --test-dir "$root/build/ci" --output-on-failure -j "$(nproc)" "$@"
