# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Functions that define the project's targets, so that flags and names are stated once.

# Warnings and float behaviour of our own translation units; never exported to users.
function(lineament_private_flags target)
    target_compile_features(${target} PRIVATE cxx_std_20)
    set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
    # No fused contraction: the same bits from every compiler.
    target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wno-sign-conversion
                                             # Wrong alarms of GCC 12 on std::string (bug 105651).
                                             $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
                                             -ffp-contract=off $<$<BOOL:${LINEAMENT_WARNINGS_AS_ERRORS}>:-Werror>)
endfunction()

# Compiles Eigen, common standard headers and the model once for the target, and the further headers named.
#   lineament_precompile(lineament_io NOT_BY_GNU <nlohmann/json.hpp>)
# NOT_BY_GNU: GCC 12 gives false alarms about strings (-Warray-bounds) where precompiled headers meet much text.
function(lineament_precompile target)
    cmake_parse_arguments(precompile "NOT_BY_GNU" "" "" ${ARGN})
    if(precompile_NOT_BY_GNU AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
        return()
    endif()
    target_precompile_headers(${target} PRIVATE <Eigen/Dense> <algorithm> <array> <cmath> <filesystem> <map> <optional>
                                                <string> <vector> ${precompile_UNPARSED_ARGUMENTS}
                                                ${PROJECT_SOURCE_DIR}/include/lineament/camera/angles.hpp
                                                ${PROJECT_SOURCE_DIR}/include/lineament/model/morphable_model.hpp)
    # Lets ccache see what a file includes besides.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endfunction()

# Declares include/lineament/<module>/*.hpp of the named modules as the public headers of <target>.
# The headers are listed in include/lineament/<module>/headers.cmake: `headers`, and `definitions` for those that only
# hold the definitions of others, which include them.
function(lineament_public_headers target scope)
    set(files)
    set(definition_files)
    foreach(module IN LISTS ARGN)
        set(headers)
        set(definitions)
        include(${PROJECT_SOURCE_DIR}/include/lineament/${module}/headers.cmake)
        list(TRANSFORM headers PREPEND ${PROJECT_SOURCE_DIR}/include/lineament/${module}/ OUTPUT_VARIABLE module_files)
        list(APPEND files ${module_files})
        list(TRANSFORM definitions PREPEND ${PROJECT_SOURCE_DIR}/include/lineament/${module}/ OUTPUT_VARIABLE module_files)
        list(APPEND definition_files ${module_files})
    endforeach()
    set(base ${PROJECT_SOURCE_DIR}/include)
    target_sources(${target} ${scope} FILE_SET HEADERS BASE_DIRS ${base} FILES ${files})
    if(definition_files)
        target_sources(${target} ${scope} FILE_SET definitions TYPE HEADERS BASE_DIRS ${base} FILES ${definition_files})
    endif()
    set_property(GLOBAL APPEND PROPERTY LINEAMENT_PUBLIC_HEADERS ${files})
    set_property(GLOBAL APPEND PROPERTY LINEAMENT_HEADER_TARGETS ${target})
endfunction()

# A compiled library lineament_<module> with alias and export name lineament::<module>.
function(lineament_library module)
    add_library(lineament_${module} STATIC ${ARGN})
    add_library(lineament::${module} ALIAS lineament_${module})
    set_target_properties(lineament_${module} PROPERTIES EXPORT_NAME ${module} POSITION_INDEPENDENT_CODE ON)
    target_compile_features(lineament_${module} PUBLIC cxx_std_20)
    lineament_public_headers(lineament_${module} PUBLIC ${module})
    lineament_private_flags(lineament_${module})
endfunction()

# The definitions of a module of the header-only core, compiled once: lineament::<module> is a static library and sets
# LINEAMENT_COMPILED_<MODULE>, with which the module's headers are declarations alone.
#   lineament_compiled_core(fit pose.cpp)
function(lineament_compiled_core module)
    add_library(lineament_${module} STATIC ${ARGN})
    add_library(lineament::${module} ALIAS lineament_${module})
    set_target_properties(lineament_${module} PROPERTIES EXPORT_NAME ${module} POSITION_INDEPENDENT_CODE ON)
    target_link_libraries(lineament_${module} PUBLIC lineament_core)
    string(TOUPPER ${module} module_in_capitals)
    target_compile_definitions(lineament_${module} PUBLIC LINEAMENT_COMPILED_${module_in_capitals})
    lineament_private_flags(lineament_${module})
    lineament_precompile(lineament_${module})
endfunction()

# Half the time to compile for large files, by Clang, of a target whose speed does not matter.
function(lineament_compile_quickly target)
    target_compile_options(${target} PRIVATE
                           "$<$<AND:$<CXX_COMPILER_ID:Clang>,$<CONFIG:Release>>:-O1;-finline-hint-functions>")
endfunction()

# Uses the precompiled headers of the tests; the target links lineament_test_support. With LINEAMENT_QUICK_BUILD a target
# with LITTLE_ARITHMETIC is not optimised, which halves the time again. Where much is computed that would not pay: of
# one template instantiated in a test and in a library, say Eigen's matrix product, the linker takes the test's.
function(lineament_precompiled_as_tests target)
    if(LINEAMENT_QUICK_BUILD AND "LITTLE_ARITHMETIC" IN_LIST ARGN)
        target_precompile_headers(${target} REUSE_FROM lineament_unoptimised_headers)
        target_compile_options(${target} PRIVATE -O0)
    else()
        target_precompile_headers(${target} REUSE_FROM lineament_test_support)
    endif()
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endfunction()

# A GoogleTest program tests/<module>/<module>_tests with the given sources and libraries:
#   lineament_test(fit SOURCES a_test.cpp b_test.cpp LIBRARIES lineament::core)
# With LITTLE_ARITHMETIC: see lineament_precompiled_as_tests. With OPTIMISED the tests are compiled as the libraries are,
# for those that measure time.
function(lineament_test module)
    cmake_parse_arguments(test "LITTLE_ARITHMETIC;OPTIMISED" "" "SOURCES;LIBRARIES" ${ARGN})
    add_executable(${module}_tests ${test_SOURCES})
    target_link_libraries(${module}_tests PRIVATE ${test_LIBRARIES} lineament_test_support GTest::gmock GTest::gtest_main)
    lineament_private_flags(${module}_tests)
    if(NOT test_OPTIMISED)
        lineament_compile_quickly(${module}_tests) # the libraries they test are optimised as ever
    endif()
    if(test_LITTLE_ARITHMETIC)
        lineament_precompiled_as_tests(${module}_tests LITTLE_ARITHMETIC)
    else()
        lineament_precompiled_as_tests(${module}_tests)
    endif()
    gtest_discover_tests(${module}_tests TEST_PREFIX "${module}." DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
endfunction()

# Target lineament_headers compiles every public header alone. Eigen, most of the time, is precompiled: a missing header
# of Eigen is for scripts/check-source.sh to notice, a standard header that comes with Eigen is not noticed. Where
# lineament::fit and lineament::render are built, headers are seen as these show them, without definitions;
# tests/package/plain compiles those.
function(lineament_check_headers)
    get_property(headers GLOBAL PROPERTY LINEAMENT_PUBLIC_HEADERS)
    get_property(targets GLOBAL PROPERTY LINEAMENT_HEADER_TARGETS)
    set(sources)
    foreach(header IN LISTS headers)
        cmake_path(RELATIVE_PATH header BASE_DIRECTORY ${PROJECT_SOURCE_DIR}/include OUTPUT_VARIABLE name)
        set(source ${PROJECT_BINARY_DIR}/headers/${name}.cpp)
        file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${name}\"\n")
        list(APPEND sources ${source})
    endforeach()
    add_library(lineament_headers OBJECT EXCLUDE_FROM_ALL ${sources})
    target_link_libraries(lineament_headers PRIVATE ${targets} $<TARGET_NAME_IF_EXISTS:lineament_fit>
                                                    $<TARGET_NAME_IF_EXISTS:lineament_render>)
    lineament_private_flags(lineament_headers)
    target_precompile_headers(lineament_headers PRIVATE <Eigen/Dense>)
endfunction()
