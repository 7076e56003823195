// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/contour_impl.hpp"
#include "lineament/fit/silhouette_impl.hpp"
