# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Installation and the package files behind
#   find_package(lineament CONFIG [COMPONENTS core kernels render fit io report build evaluation vision])
include(CMakePackageConfigHelpers)

set(lineament_config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/lineament)
set(lineament_installed_targets lineament_core)
if(LINEAMENT_BUILD_LIBRARIES)
    list(APPEND lineament_installed_targets lineament_kernels lineament_render lineament_fit lineament_io
                                            lineament_report lineament_build lineament_evaluation lineament_lineament)
    if(LINEAMENT_BUILD_VISION)
        list(APPEND lineament_installed_targets lineament_vision)
    endif()
endif()
foreach(target IN LISTS lineament_installed_targets)
    if(NOT TARGET ${target})
        continue()
    endif()
    get_target_property(header_sets ${target} INTERFACE_HEADER_SETS)
    if(header_sets)
        list(TRANSFORM header_sets PREPEND "FILE_SET;" OUTPUT_VARIABLE header_sets)
        install(TARGETS ${target} EXPORT lineament_targets ${header_sets})
    else()
        install(TARGETS ${target} EXPORT lineament_targets)
    endif()
endforeach()
install(EXPORT lineament_targets NAMESPACE lineament:: DESTINATION ${lineament_config_dir})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/lineament-config.cmake.in
                              ${PROJECT_BINARY_DIR}/lineament-config.cmake INSTALL_DESTINATION ${lineament_config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/lineament-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/lineament-config.cmake ${PROJECT_BINARY_DIR}/lineament-config-version.cmake
        DESTINATION ${lineament_config_dir})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/models/ DESTINATION ${CMAKE_INSTALL_DATADIR}/lineament/models
        FILES_MATCHING PATTERN "*.safetensors" PATTERN "*.tflite" PATTERN "*.md")
# The networks' licence, which is also the project's; their notice stands in models/README.md.
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/lineament/models)
