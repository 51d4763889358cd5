# Builds and runs the consumer, as cmake -P with:   SPDX-License-Identifier: Apache-2.0
#   CONSUMER  its source folder        WORK      where to build it (made anew)
#   BUILD     a build of lockstep to install first, or
#   SOURCE    lockstep's source folder to add as a subdirectory, or
#   SHARED    lockstep's source folder to build and install a shared library from
#   EXPECTED  what the consumer prints, compared by the script RUN
#   GENERATOR, COMPILER, BUILD_TYPE, FLAGS
cmake_minimum_required(VERSION 3.22)
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK})
if(SOURCE)
  set(where -DLOCKSTEP_SOURCE_DIR=${SOURCE})
else()
  if(SHARED)
    set(BUILD ${WORK}/shared)
    run(${CMAKE_COMMAND} -S ${SHARED} -B ${BUILD} -G ${GENERATOR} -DBUILD_SHARED_LIBS=ON -DCMAKE_CXX_COMPILER=${COMPILER}
        -DCMAKE_BUILD_TYPE=${BUILD_TYPE} -DCMAKE_CXX_FLAGS=${FLAGS})
    run(${CMAKE_COMMAND} --build ${BUILD})
  endif()
  run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
  set(where -DCMAKE_PREFIX_PATH=${WORK}/prefix)
  if(EXISTS ${WORK}/prefix/bin/lockstep)
    run(${WORK}/prefix/bin/lockstep --version)
  endif()
endif()
run(${CMAKE_COMMAND} -S ${CONSUMER} -B ${WORK}/build -G ${GENERATOR} ${where}
    -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_BUILD_TYPE=${BUILD_TYPE} -DCMAKE_CXX_FLAGS=${FLAGS})
run(${CMAKE_COMMAND} --build ${WORK}/build)
if(NOT EXPECTED)
  run(${WORK}/build/consumer)
else()
  run(${CMAKE_COMMAND} -DPROGRAM=${WORK}/build/generated -DEXPECTED=${EXPECTED} -P ${RUN})
endif()
