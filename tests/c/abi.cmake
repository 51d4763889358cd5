# Compares the C interface with the stored one, as cmake -P with:   SPDX-License-Identifier: Apache-2.0
#   LIBRARY, HEADER, BASELINE, CC, NM, ABIDW, ABIDIFF, WORK
# What programs rely on is what c.h declares. So the functions are given empty bodies here, and what a C compiler makes of
# them is described. With -DSTORE=ON the description is stored: only where functions or members were added.
cmake_minimum_required(VERSION 3.22)
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(MAKE_DIRECTORY ${WORK})
file(READ ${HEADER} header)
string(REGEX MATCHALL "LOCKSTEP_C_API [^;]*[ *]lockstep_[a-z_]+\\(" declared "${header}")
list(TRANSFORM declared REPLACE ".*[ *](lockstep_[a-z_]+)\\(" "\\1")
string(REGEX REPLACE "LOCKSTEP_C_API void ([^;]*);" "void \\1 {}" bodies "${header}")
string(REGEX REPLACE "LOCKSTEP_C_API ([^;]*\\));" "LOCKSTEP_C_API \\1 { return 0; }" bodies "${bodies}")
string(REPLACE "[7]) {" "[7]) {" bodies "${bodies}")
file(WRITE ${WORK}/abi.c "${bodies}")
execute_process(COMMAND ${CC} -g -shared -fPIC -w -o libabi.so abi.c WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
run(${ABIDW} --no-corpus-path --no-comp-dir-path --no-show-locs --no-elf-needed --no-architecture --out-file ${WORK}/abi.xml
    ${WORK}/libabi.so)
if(STORE)
  file(COPY_FILE ${WORK}/abi.xml ${BASELINE})
endif()
execute_process(COMMAND ${ABIDIFF} --no-added-syms --no-architecture ${BASELINE} ${WORK}/abi.xml OUTPUT_VARIABLE report
                RESULT_VARIABLE changed)
if(changed)
  message(SEND_ERROR "the C interface has changed:\n${report}")
endif()

# The library has these functions, and shows no names that are not its own.
execute_process(COMMAND ${NM} -D --defined-only ${LIBRARY} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[0-9a-f]+ [A-Za-z] [^\n]+" lines "${symbols}")
set(shown "")
foreach(line ${lines})
  if(NOT line MATCHES "lockstep")
    message(SEND_ERROR "the library shows a name that is not its own: ${line}")
  elseif(line MATCHES " T (lockstep_.*)")
    list(APPEND shown ${CMAKE_MATCH_1})
  endif()
endforeach()
list(SORT declared)
list(SORT shown)
if(NOT declared STREQUAL shown)
  message(SEND_ERROR "c.h declares ${declared}, the library has ${shown}")
endif()
