// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// As fit/inline.hpp: the definitions in *_impl.hpp come with their declarations and are inline, unless the CMake
/// target lineament::render, which sets LINEAMENT_COMPILED_RENDER, has them compiled once, in src/render.
#ifdef LINEAMENT_COMPILED_RENDER
#define LINEAMENT_RENDER_INLINE
#else
#define LINEAMENT_RENDER_INLINE inline
#endif
