// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/identity_filter_impl.hpp"
#include "lineament/fit/identity_impl.hpp"
