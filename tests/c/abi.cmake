# Compares the C interface of the library with the stored one, as cmake -P with:   SPDX-License-Identifier: Apache-2.0
#   LIBRARY, HEADER, BASELINE, ABIDW, ABIDIFF, NM, WORK
# With -DSTORE=ON it stores the present one: only where functions or members were added.
cmake_minimum_required(VERSION 3.22)

# Only lockstep's own names are shown: those of C begin with lockstep_, those of C++ lie in its namespace.
execute_process(COMMAND ${NM} -D --defined-only ${LIBRARY} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[0-9a-f]+ [A-Z] [^\n]+" lines "${symbols}")
foreach(line ${lines})
  if(NOT line MATCHES " [A-Z] (lockstep_|_ZNK?[KS]*[0-9A-Z_]*8lockstep|_ZT[ISVC]N?8lockstep|_ZT[ISV]N8lockstep|_ZGV|_ZZN)")
    list(APPEND strange ${line})
  endif()
endforeach()
if(strange)
  message(FATAL_ERROR "the library shows names that are not its own: ${strange}")
endif()

file(WRITE ${WORK}/only_c.ini "[suppress_function]\nsymbol_name_not_regexp = ^lockstep_\n[suppress_variable]\nsymbol_name_regexp = .*\n")
execute_process(COMMAND ${ABIDW} --suppressions ${WORK}/only_c.ini --no-corpus-path --no-comp-dir-path --no-show-locs
                        --type-id-style hash --header-file ${HEADER} --drop-private-types --out-file ${WORK}/abi.xml ${LIBRARY}
                COMMAND_ERROR_IS_FATAL ANY)
if(STORE)
  file(COPY_FILE ${WORK}/abi.xml ${BASELINE})
  return()
endif()
execute_process(COMMAND ${ABIDIFF} --suppressions ${WORK}/only_c.ini --no-added-syms ${BASELINE} ${WORK}/abi.xml
                OUTPUT_VARIABLE report RESULT_VARIABLE changed)
if(changed)
  message(FATAL_ERROR "the C interface has changed:\n${report}")
endif()
