# The library as applications get it: installed and found, with other compiler flags, as a subdirectory.
function(lockstep_packaging_test name labels)
  add_test(NAME packaging.${name}
           COMMAND ${CMAKE_COMMAND} -DCONSUMER=${CMAKE_CURRENT_FUNCTION_LIST_DIR} -DBUILD=${PROJECT_BINARY_DIR}
                   -DWORK=${CMAKE_CURRENT_BINARY_DIR}/packaging/${name} -DGENERATOR=${CMAKE_GENERATOR}
                   -DCOMPILER=${CMAKE_CXX_COMPILER} -DBUILD_TYPE=${CMAKE_BUILD_TYPE} ${ARGN}
                   -P ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/consume.cmake)
  set_tests_properties(packaging.${name} PROPERTIES LABELS "packaging;${labels}" COST 30)  # long, so early
endfunction()

set(flags "")
if(LOCKSTEP_SANITIZE)
  set(flags -fsanitize=address,undefined)
endif()
set(other_languages -DC_MODEL=${PROJECT_SOURCE_DIR}/tests/models/gripper.urdf)
if(TARGET lockstep_python AND NOT LOCKSTEP_SANITIZE)
  list(APPEND other_languages -DPYTHON=${LOCKSTEP_PYTHON} -DPYTHON_DIR=${LOCKSTEP_PYTHON_DIR}
       -DC_SOURCE=${PROJECT_SOURCE_DIR}/tests/c/consumer.c)
endif()
lockstep_packaging_test(installed "" "-DFLAGS=${flags}" ${other_languages})
set(examples ${PROJECT_SOURCE_DIR}/docs/examples)
lockstep_packaging_test(example "examples" "-DFLAGS=${flags}" -DCONSUMER=${examples}/generated
                        -DEXPECTED=${examples}/generated/main.expected -DRUN=${examples}/run.cmake)
# Eigen aligns more strictly under AVX: nothing that crosses the library's border may depend on it.
file(STRINGS /proc/cpuinfo avx2 REGEX avx2 LIMIT_COUNT 1)
if(avx2)
  lockstep_packaging_test(installed_for_avx slow "-DFLAGS=${flags} -mavx2 -mfma")
endif()
lockstep_packaging_test(shared slow -DSHARED=${PROJECT_SOURCE_DIR} "-DFLAGS=${flags}")
lockstep_packaging_test(subdirectory slow -DSOURCE=${PROJECT_SOURCE_DIR} "-DFLAGS=${flags}")
if(TARGET lockstep_python)
  add_test(NAME packaging.wheel
           COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DPYTHON=${LOCKSTEP_PYTHON}
                   -DWORK=${CMAKE_CURRENT_BINARY_DIR}/packaging/wheel -DMODEL=${PROJECT_SOURCE_DIR}/tests/models/gripper.urdf
                   -P ${CMAKE_CURRENT_LIST_DIR}/wheel.cmake)
  set_tests_properties(packaging.wheel PROPERTIES LABELS "packaging;slow" TIMEOUT 3600 SKIP_REGULAR_EXPRESSION "skipped:")
endif()
