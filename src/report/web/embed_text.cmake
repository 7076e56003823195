# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
#
# Writes <OUTPUT>, a C++ source that defines one std::string_view in lineament::html for each name=file of FILES:
#   cmake -DOUTPUT=web.cpp "-DFILES=viewer_js=viewer.js,report_css=report.css" -P embed_text.cmake
# The leading licence comment lines stay in the text, so that a page carries its own licence.
string(REPLACE "," ";" entries "${FILES}")
set(source "// Made by src/report/web/embed_text.cmake from the files beside it.\n#include \"report/web.hpp\"\n\n")
string(APPEND source "namespace lineament::html {\n\n")
foreach(entry IN LISTS entries)
    string(REGEX MATCH "^([a-z_]+)=(.*)$" matched "${entry}")
    if(NOT matched)
        message(FATAL_ERROR "embed_text: expected name=file, got ${entry}")
    endif()
    set(name ${CMAKE_MATCH_1})
    file(READ "${CMAKE_MATCH_2}" bytes HEX) # as hexadecimal digits, so that ; and [ in the text mean nothing to CMake
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" bytes "${bytes}") # every byte escaped
    string(REPLACE "\\x0a" "\\x0a\"\n\"" bytes "${bytes}") # a line of text a line of source
    string(APPEND source "namespace {\nconstexpr char ${name}_bytes[] =\n\"${bytes}\";\n}\n")
    string(APPEND source "const std::string_view ${name}(${name}_bytes, sizeof ${name}_bytes - 1);\n\n")
endforeach()
string(APPEND source "} // namespace lineament::html\n")
file(WRITE "${OUTPUT}" "${source}")
