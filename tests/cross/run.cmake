# Builds for another processor, runs tests in its emulator and compares bits. SPDX-License-Identifier: Apache-2.0
# cmake -P with:
#   SOURCE, TOOLCHAIN, GENERATOR   how to build
#   WORK                           where to build
#   GOLDEN                         the program golden for this processor
cmake_minimum_required(VERSION 3.22)
include(${TOOLCHAIN})
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

foreach(program ${CMAKE_CXX_COMPILER} ${CMAKE_CROSSCOMPILING_EMULATOR})
  find_program(found ${program} NO_CACHE)
  if(NOT found)
    message("skipped: there is no ${program}")
    return()
  endif()
  unset(found)
endforeach()
foreach(library TBB fmt tinyxml2 GTest Qhull)
  if(NOT EXISTS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/${library})
    message("skipped: there is no ${library} for ${CMAKE_LIBRARY_ARCHITECTURE}")
    return()
  endif()
endforeach()

if(NOT EXISTS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/libz.so)
  message("skipped: there is no zlib for ${CMAKE_LIBRARY_ARCHITECTURE}")
  return()
endif()

run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK} -G ${GENERATOR} -DCMAKE_TOOLCHAIN_FILE=${TOOLCHAIN}
    -DCMAKE_BUILD_TYPE=Release -DLOCKSTEP_BUILD_TOOL=OFF -DLOCKSTEP_BUILD_BENCH=OFF
    -DLOCKSTEP_BUILD_PYTHON=OFF -DLOCKSTEP_INSTALL=OFF)
run(${CMAKE_COMMAND} --build ${WORK} --target golden simd_test)

execute_process(COMMAND ${GOLDEN} OUTPUT_VARIABLE here COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_CROSSCOMPILING_EMULATOR} ${WORK}/tests/cross/golden OUTPUT_VARIABLE there
                COMMAND_ERROR_IS_FATAL ANY)
if(NOT here STREQUAL there)
  message(FATAL_ERROR "the bits differ: here\n${here}and on ${CMAKE_SYSTEM_PROCESSOR}\n${there}")
endif()
run(${CMAKE_CROSSCOMPILING_EMULATOR} ${WORK}/tests/simd_test --gtest_brief=1)
