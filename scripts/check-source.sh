#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Rules that hold of every source file: licence lines, format, the direction of includes. Prints what breaks them.
set -uo pipefail
cd "$(dirname "$0")/.."
failures=0
complain() { printf '%s\n' "$*"; failures=$((failures + 1)); }

if git rev-parse > /dev/null 2>&1; then
    files=$(git ls-files --cached --others --exclude-standard)
else
    files=$(find . -type f -not -path './build/*' -not -path './out/*' | sed 's#^\./##')
fi
sources=$(grep -E '\.(hpp|cpp)$' <<< "$files")

for file in $(grep -E '\.(hpp|cpp|cmake|sh|js|py)$|CMakeLists\.txt$' <<< "$files"); do
    [ -e "$file" ] || continue
    case "$file" in include/*/headers.cmake) continue ;; esac
    head -n 4 "$file" | grep -q 'SPDX-License-Identifier: Apache-2.0' || complain "$file: no SPDX licence line"
done

if command -v clang-format > /dev/null && clang-format --version | grep -q 'version 14'; then
    unformatted=$(xargs clang-format --dry-run -Werror <<< "$sources" 2>&1 | grep -oE '^[^:]+:' | sort -u)
    [ -z "$unformatted" ] || complain "not formatted (clang-format -i): $unformatted"
else
    echo "clang-format 14 is not installed: formatting not checked"
fi

# A module includes only modules below it; the order of this table is low to high.
declare -A allowed=(
    [core]="core" [model]="core model" [camera]="core camera" [render]="core model camera render"
    [kernels]="kernels" [fit]="core model camera render kernels fit" [io]="core model camera render kernels fit io"
    [build]="core model camera render kernels fit io build"
    [evaluation]="core model camera render kernels fit io evaluation" [vision]="core model camera render kernels fit io vision"
    [report]="core model camera render kernels fit io report")
for file in $sources; do
    [ -e "$file" ] || continue
    module=$(sed -nE 's#^(include/lineament|src)/([a-z]+)/.*#\2#p' <<< "$file")
    [ -n "$module" ] && [ -n "${allowed[$module]:-}" ] || continue
    for included in $(grep -oE '^#include "lineament/[a-z]+/' "$file" | cut -d/ -f2 | sort -u); do
        [[ " ${allowed[$module]} " == *" $included "* ]] || complain "$file: module $module must not include $included"
    done
    case "$module" in
    core | model | camera | render | kernels | fit)
        grep -nE '#include <(iostream|sstream|fstream|ranges|format|nlohmann|CLI|filesystem)' "$file" &&
            complain "$file: the header-only core does not include these" ;;
    esac
done

# What of Eigen a header uses it includes itself; definitions (*_impl.hpp) may leave Eigen/Core to their declarations.
while read -r header pattern; do
    for file in $(grep -E '^include/' <<< "$sources" | xargs grep -lE "$pattern"); do
        case "$header,$file" in Core,*_impl.hpp) continue ;; Core,*) any=Eigen/ ;; *) any="Eigen/($header|Dense)>" ;; esac
        grep -qE "#include <$any" "$file" || complain "$file: uses $pattern without #include <Eigen/$header>"
    done
done << 'EOF'
Core Eigen::
Cholesky \.llt\(\)|\.ldlt\(\)|Eigen::LLT|Eigen::LDLT
Eigenvalues SelfAdjointEigenSolver
Geometry AngleAxis|Quaternion|AlignedBox|\.cross\(
LU PivLu|\.determinant\(\)|\.inverse\(\)
QR [hH]ouseholderQ[rR]
SVD JacobiSVD|BDCSVD
EOF

# A header that no list names is not installed.
for file in $(grep -E '^include/lineament/[a-z]+/[a-z_0-9]+\.hpp$' <<< "$sources"); do
    [ -e "$file" ] || continue
    module=$(cut -d/ -f3 <<< "$file")
    grep -qsw "$(basename "$file")" "include/lineament/$module/headers.cmake" "src/$module/CMakeLists.txt" ||
        complain "$file: not in include/lineament/$module/headers.cmake"
done

# The locale must not change a number: no locale-dependent conversion outside of messages.
grep -nE '\b(strtod|strtof|stof|stod|atof|setlocale)\b' $(grep -E '^(include|src|apps)/' <<< "$sources") && complain "use std::from_chars"
if [ "$failures" -gt 0 ]; then
    echo "$failures problem(s)"
    exit 1
fi
echo "source tree is in order"
