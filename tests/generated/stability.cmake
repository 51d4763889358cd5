# Compiles kernels for all plans of the stability tests, which then run on them. SPDX-License-Identifier: Apache-2.0
#   cmake -DSUITE=stability_test -DCOMPILER=g++ -DINCLUDE=src -DWORK=folder [-DFILTER=...] [-DJOBS=2] -P stability.cmake
cmake_minimum_required(VERSION 3.22)
if(NOT FILTER)
  set(FILTER "-RandomScenes*")  # these would need hundreds of kernels more
endif()
if(NOT JOBS)
  cmake_host_system_information(RESULT JOBS QUERY NUMBER_OF_LOGICAL_CORES)
endif()
file(STRINGS /proc/cpuinfo avx2 REGEX avx2 LIMIT_COUNT 1)
if(NOT avx2)
  message("skipped: this machine lacks AVX2")
  return()
endif()
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})

function(suite)
  execute_process(COMMAND ${CMAKE_COMMAND} -E env LOCKSTEP_TARGET=avx2 ${ARGV}
                          ${SUITE} --gtest_brief=1 --gtest_filter=${FILTER}
                  COMMAND_ERROR_IS_FATAL ANY)
endfunction()

suite(LOCKSTEP_COLLECT_KERNELS=${WORK})
# The largest plans would take a compiler many seconds each, so they stay on the tables.
file(GLOB sources ${WORK}/*.cpp)
set(large 0)
foreach(source ${sources})
  file(SIZE ${source} size)
  if(size GREATER 1000000)
    file(REMOVE ${source})
    math(EXPR large "${large} + 1")
  endif()
endforeach()
file(GLOB sources ${WORK}/*.cpp)
list(LENGTH sources count)
if(count LESS 50)
  message(FATAL_ERROR "the suite wrote only ${count} kernels; at least 50 were expected")
endif()
message("${count} kernels to compile, ${large} left out because of their size")

# All kernels are in one project, so that the build tool compiles them in parallel.
set(names "")
foreach(source ${sources})
  get_filename_component(name ${source} NAME_WE)
  list(APPEND names ${name}_avx2)
endforeach()
list(JOIN names ", " registered)
file(WRITE ${WORK}/registered.cc
  "#include \"targets/generated_kernel.h\"\nnamespace lockstep {\nextern const GeneratedKernel ${registered};\n")
foreach(name ${names})  # one constant for each: compilers limit the number of arguments
  file(APPEND ${WORK}/registered.cc "static const RegisterKernels register_${name}{${name}};\n")
endforeach()
file(APPEND ${WORK}/registered.cc "}\n")
string(REPLACE "," " " includes "${INCLUDE}")
file(WRITE ${WORK}/CMakeLists.txt "
cmake_minimum_required(VERSION 3.22)
project(suite_kernels LANGUAGES CXX)
file(GLOB sources *.cpp)
add_library(suite_kernels SHARED \${sources} registered.cc)
target_compile_features(suite_kernels PRIVATE cxx_std_20)
target_compile_definitions(suite_kernels PRIVATE LOCKSTEP_KERNEL_TARGET=avx2)
target_include_directories(suite_kernels PRIVATE ${includes})
target_compile_options(suite_kernels PRIVATE -O0 -ffp-contract=off -fno-math-errno -mavx2 -mfma)
")
foreach(step "-S;${WORK};-B;${WORK}/build;-DCMAKE_CXX_COMPILER=${COMPILER};-DCMAKE_BUILD_TYPE=None"
             "--build;${WORK}/build;-j;${JOBS}")
  execute_process(COMMAND ${CMAKE_COMMAND} ${step} OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endforeach()
suite(LOCKSTEP_EXPECT_KERNELS=${WORK} LD_PRELOAD=${WORK}/build/libsuite_kernels.so)
