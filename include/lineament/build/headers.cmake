# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
set(headers
    decimation.hpp
    default_model.hpp
    isomap_embedding.hpp
    makehuman_package.hpp
)
