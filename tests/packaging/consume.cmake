# Builds and runs the consumer, as cmake -P with:   SPDX-License-Identifier: Apache-2.0
#   CONSUMER  its source folder        WORK      where to build it (made anew)
#   BUILD     a build of lockstep to install first, or
#   SOURCE    lockstep's source folder to add as a subdirectory, or
#   SHARED    lockstep's source folder to build and install a shared library from
#   EXPECTED  what the consumer prints, compared by the script RUN
#   PYTHON, PYTHON_DIR  an interpreter that imports the installed package from that folder below the prefix, if given
#   C_SOURCE  a C program with c.h, built by pkg-config and run on the model C_MODEL, if given
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
  if(PYTHON)
    run(${CMAKE_COMMAND} -E env PYTHONPATH=${WORK}/prefix/${PYTHON_DIR} PYTHONDONTWRITEBYTECODE=1 ${PYTHON}
        -c "import lockstep; lockstep.compile(lockstep.from_urdf('${C_MODEL}')).batch(3).step()")
  endif()
  find_program(PKG_CONFIG pkg-config)
  if(C_SOURCE AND PKG_CONFIG)
    set(ENV{PKG_CONFIG_PATH} ${WORK}/prefix/lib/pkgconfig)
    execute_process(COMMAND ${PKG_CONFIG} --cflags --libs lockstep OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
    separate_arguments(flags UNIX_COMMAND "${flags}")
    run(cc -std=c89 -pedantic -Wall -Wextra -Werror -o ${WORK}/c_consumer ${C_SOURCE} ${flags} -lm
        -Wl,-rpath,${WORK}/prefix/lib)
    run(${WORK}/c_consumer ${C_MODEL})
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
