// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Header-only by default: the solvers' definitions, in *_impl.hpp, come with their declarations and are inline.
/// With LINEAMENT_COMPILED_FIT, which the CMake target lineament::fit sets, they are compiled once, in src/fit, and a
/// file that includes them compiles in a fifth of the time.
#ifdef LINEAMENT_COMPILED_FIT
#define LINEAMENT_FIT_INLINE
#else
#define LINEAMENT_FIT_INLINE inline
#endif
