# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Shared by the scripts beside it: steps with progress, and the packages each job needs. Source it, do not run it.

set -Eeuo pipefail # E: on_error also for what fails inside a function
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cache=${XDG_CACHE_HOME:-$HOME/.cache}/lineament
log=$(mktemp -t lineament-log-XXXXXX)
step_name=start

build_packages=(g++ cmake ninja-build ccache pkg-config libeigen3-dev libpng-dev libdeflate-dev libjpeg62-turbo-dev
                libdlib-dev libdlib-data libavformat-dev libavcodec-dev libswscale-dev libavutil-dev nlohmann-json3-dev libcli11-dev
                libxnnpack-dev libpthreadpool-dev libcpuinfo-dev libhwy-dev)
test_packages=(clang libgtest-dev libgmock-dev libbenchmark-dev)

exec {messages}>&2 # also from within a step, whose output goes into the log
say() { printf '%s\n' "$*" >&"$messages"; }

on_error() {
    say "" "lineament: step failed: $step_name"
    if [ -s "$log" ]; then
        say "last lines of its output (all of it: $log):"
        tail -n 25 "$log" >&"$messages"
    fi
    say "After mending the cause run the same command again; finished steps are not repeated."
}
trap on_error ERR

# step NAME COMMAND...: runs the command with its output in the log and says how long it took.
step() {
    step_name=$1
    shift
    local begin=$SECONDS
    say "== $step_name"
    "$@" > "$log" 2>&1
    say "   done ($((SECONDS - begin)) s)"
}

# try_step NAME COMMAND...: the same, but where the command fails the run goes on; the command must check its own parts.
try_step() {
    say "== $1"
    local begin=$SECONDS
    if "${@:2}" > "$log" 2>&1; then
        say "   done ($((SECONDS - begin)) s)"
    else
        say "   not done; going on without: $(tail -n 1 "$log")"
    fi
}

# Installs the missing ones of the named Debian packages; nothing is asked of apt if all are there.
install_packages() {
    local missing=()
    for package in "$@"; do
        dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
    done
    if [ ${#missing[@]} -eq 0 ]; then
        return
    fi
    local sudo=
    if [ "$(id -u)" != 0 ]; then
        command -v sudo > /dev/null || { echo "not root and no sudo; install: ${missing[*]}"; return 1; }
        sudo=sudo
    fi
    $sudo apt-get update
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}"
}

# configure PRESET [CMAKE_ARGUMENT...]
configure() {
    local preset=$1
    shift
    # pch_defines, time_macros: without them ccache keeps nothing that uses precompiled headers.
    cmake --preset "$preset" -S "$root" \
        "-DCMAKE_CXX_COMPILER_LAUNCHER=env;CCACHE_SLOPPINESS=pch_defines,time_macros;CCACHE_DEPEND=1;ccache" "$@"
}

# fetch_npm_package NAME VERSION FOLDER: unpacks the package into FOLDER unless it is there; 1 where it cannot be had.
fetch_npm_package() {
    local name=$1 version=$2 folder=$3
    if [ -e "$folder/package.json" ]; then
        return
    fi
    local work
    work=$(mktemp -d)
    if ! (cd "$work" && npm pack --loglevel=error --fetch-retries=1 --fetch-retry-mintimeout=1000 "$name@$version" &&
          mkdir -p "$folder.part" && tar -xzf ./*.tgz -C "$folder.part" --strip-components=1); then
        rm -rf "$work" "$folder.part"
        echo "$name@$version could not be fetched"
        return 1
    fi
    rm -rf "$work" "$folder"
    mv "$folder.part" "$folder"
}
