# `pip install` of the source, in an environment of its own, as cmake -P with:   SPDX-License-Identifier: Apache-2.0
#   SOURCE  lockstep's source folder   PYTHON  the interpreter   WORK  where to install (made anew)   MODEL  a URDF file
cmake_minimum_required(VERSION 3.22)
execute_process(COMMAND ${PYTHON} -c "import ensurepip, venv" RESULT_VARIABLE missing ERROR_QUIET)
if(missing)
  message("skipped: ${PYTHON} has no venv; Debian has it in python3-venv")
  return()
endif()
function(run)
  execute_process(COMMAND ${ARGV} WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
unset(ENV{PYTHONPATH})
run(${PYTHON} -m venv --system-site-packages env)
run(env/bin/pip install --no-index ${SOURCE})  # no network
run(env/bin/python -c "
import lockstep, sys
assert lockstep.__file__.startswith(sys.prefix), lockstep.__file__
lockstep.compile(lockstep.from_urdf('${MODEL}')).batch(3).step()")
