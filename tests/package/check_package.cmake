# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
file(REMOVE_RECURSE ${work_dir})
file(MAKE_DIRECTORY ${work_dir})

function(run)
    execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(NOT result EQUAL 0)
        message(FATAL_ERROR "failed (${result}): ${ARGN}\n${output}")
    endif()
    message(STATUS "${output}")
endfunction()

set(here ${source_dir}/tests/package)
if(way STREQUAL plain)
    run(${compiler} -std=c++20 -Wall -Wextra -Werror -O1 -I ${source_dir}/include -isystem ${eigen} ${here}/plain/main.cpp
        -o ${work_dir}/plain)
    run(${work_dir}/plain)
    return()
endif()
if(way STREQUAL solvers)
    run(${project_compiler} -std=c++20 -Wall -Wextra -Werror -O0 -I ${source_dir}/include -I ${source_dir}/tests
        -isystem ${eigen} ${here}/plain/fit.cpp -o ${work_dir}/fit)
    run(${work_dir}/fit)
    return()
endif()
if(way STREQUAL renderer)
    run(${project_compiler} -std=c++20 -Wall -Wextra -Werror -O0 -I ${source_dir}/include -isystem ${eigen}
        ${here}/plain/render.cpp -o ${work_dir}/render)
    run(${work_dir}/render)
    return()
endif()
if(way STREQUAL emscripten)
    file(GLOB headers RELATIVE ${source_dir}/include ${source_dir}/include/lineament/core/*.hpp
         ${source_dir}/include/lineament/model/*.hpp ${source_dir}/include/lineament/camera/*.hpp
         ${source_dir}/include/lineament/render/*.hpp ${source_dir}/include/lineament/fit/*.hpp)
    list(TRANSFORM headers PREPEND "#include \"")
    list(TRANSFORM headers APPEND "\"\n")
    list(JOIN headers "" text)
    file(WRITE ${work_dir}/core.cpp "${text}")
    set(ENV{NODE_PATH} /usr/share/nodejs) # Debian's em++ does not find its own modules
    run(${emxx} -std=c++20 -O1 -Wall -Wextra -Werror -I ${source_dir}/include -isystem ${eigen} -c ${work_dir}/core.cpp
        -o ${work_dir}/core.o)
    return()
endif()
if(way STREQUAL installed)
    run(${CMAKE_COMMAND} --install ${binary_dir} --prefix ${work_dir}/prefix)
    set(arguments -DCMAKE_PREFIX_PATH=${work_dir}/prefix)
    set(models ${work_dir}/prefix/${data_dir}/lineament/models)
    set(model ${models}/lineament-face-1.safetensors)
    if(EXISTS ${models}/face_landmark_with_attention.tflite AND NOT EXISTS ${models}/LICENSE)
        message(FATAL_ERROR "the networks are installed without their licence")
    endif()
else()
    set(arguments -DLINEAMENT_SUBDIRECTORY=${source_dir} -DLINEAMENT_BUILD_LIBRARIES=OFF)
endif()
run(${CMAKE_COMMAND} -S ${here}/consumer -B ${work_dir}/build -DCMAKE_CXX_COMPILER=${compiler} ${arguments})
run(${CMAKE_COMMAND} --build ${work_dir}/build)
run(${work_dir}/build/consumer ${model})
