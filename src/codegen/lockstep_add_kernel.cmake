# Generated kernels at build time. SPDX-License-Identifier: Apache-2.0
#
#   lockstep_add_kernel(target MODEL robot.urdf [NAME name] [PRECISION f32|f64|both] [TARGETS avx2 ...]
#                       [OPTIONS --dt 1/240 ...])
#
# runs `lockstep generate` on the model, compiles the kernel for every instruction set of the library (or only for the
# TARGETS) and links it to the target. Batches of the same plan then use it. OPTIONS are those of the command. NAME must
# be unique in the program; by default it is the file's name.
#
#   lockstep_add_kernel_source(target NAME name SOURCE file.cpp [TARGETS avx2 ...])
#
# does the second half, for a file that generate_kernel() wrote.

function(lockstep_add_kernel target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "MODEL;NAME;PRECISION" "OPTIONS;TARGETS")
  if(NOT arg_MODEL OR arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "lockstep_add_kernel(${target}): give MODEL; besides, only NAME, PRECISION, TARGETS and "
                        "OPTIONS are allowed")
  endif()
  get_filename_component(model ${arg_MODEL} ABSOLUTE)
  if(NOT arg_NAME)
    get_filename_component(arg_NAME ${arg_MODEL} NAME_WE)
  endif()
  string(MAKE_C_IDENTIFIER ${arg_NAME} name)
  if(NOT arg_PRECISION)
    set(arg_PRECISION both)
  endif()
  if(TARGET lockstep_tool)
    set(command lockstep_tool)
  elseif(TARGET lockstep::lockstep_tool)
    set(command lockstep::lockstep_tool)
  else()
    message(FATAL_ERROR "lockstep_add_kernel(${target}): this needs the lockstep command, which this build does not "
                        "have; set LOCKSTEP_BUILD_TOOL to ON")
  endif()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${target}_kernels/${name}.cpp)
  file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/${target}_kernels)
  add_custom_command(OUTPUT ${source} DEPENDS ${model} ${command} VERBATIM
    COMMAND ${command} generate ${model} --out ${source} --name ${name} --precision ${arg_PRECISION} ${arg_OPTIONS})
  lockstep_add_kernel_source(${target} NAME ${name} SOURCE ${source} TARGETS ${arg_TARGETS})
endfunction()

function(lockstep_add_kernel_source target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "NAME;SOURCE" "TARGETS")
  if(NOT arg_NAME OR NOT arg_SOURCE OR arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "lockstep_add_kernel_source(${target}): give NAME and SOURCE; besides, only TARGETS is allowed")
  endif()
  string(MAKE_C_IDENTIFIER ${arg_NAME} identifier)
  if(NOT identifier STREQUAL arg_NAME)
    message(FATAL_ERROR "lockstep_add_kernel_source(${target}): NAME ${arg_NAME} is not a C identifier; "
                        "give the name that the kernel was generated with")
  endif()
  set(targets baseline)
  set(flags_baseline "")
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    list(APPEND targets neon)
    set(flags_neon "")
  else()
    list(APPEND targets avx2 avx512)
    set(flags_avx2 -mavx2 -mfma)
    set(flags_avx512 -mavx512f -mavx512bw -mavx512dq -mavx512vl -mfma)
  endif()
  if(NOT arg_TARGETS)
    set(arg_TARGETS ${targets})
  endif()
  set(declared "")
  set(registered "")
  foreach(isa ${arg_TARGETS})
    if(NOT isa IN_LIST targets)
      message(FATAL_ERROR "lockstep_add_kernel: there is no target ${isa} on this processor; there are ${targets}")
    endif()
    set(object ${target}_${arg_NAME}_${isa})
    add_library(${object} OBJECT ${arg_SOURCE})
    target_compile_features(${object} PRIVATE cxx_std_20)
    target_include_directories(${object} PRIVATE ${LOCKSTEP_KERNEL_INCLUDE_DIRS})
    target_compile_definitions(${object} PRIVATE LOCKSTEP_KERNEL_TARGET=${isa})
    # The flags of the library's own kernels: no errno, no traps, no multiply-add that the code does not ask for. The
    # flags for g++ suit straight lines of thousands of operations: they keep the lifetimes of values short.
    target_compile_options(${object} PRIVATE -O3 -ffp-contract=off -fno-math-errno -fno-trapping-math ${flags_${isa}})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${object} PRIVATE -flive-range-shrinkage -fno-gcse -fno-tree-pre -fno-tree-ter
                             -fno-forward-propagate -frename-registers)
    endif()
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${object}>)
    string(APPEND declared "extern const GeneratedKernel ${arg_NAME}_${isa};\n")
    list(APPEND registered ${arg_NAME}_${isa})
  endforeach()
  list(JOIN registered ", " registered)
  set(registration ${CMAKE_CURRENT_BINARY_DIR}/${target}_kernels/${arg_NAME}_registered.cpp)
  file(CONFIGURE OUTPUT ${registration} @ONLY CONTENT [=[
// Registers the generated kernels before main(). Every machine can run this file, but not every kernel.
#include "targets/generated_kernel.h"

namespace lockstep {

@declared@
namespace {
const RegisterKernels registered{@registered@};
}  // namespace

}  // namespace lockstep

extern "C" void lockstep_kernel_@arg_NAME@() {}
]=])
  target_sources(${target} PRIVATE ${registration})
  set_source_files_properties(${registration} PROPERTIES INCLUDE_DIRECTORIES "${LOCKSTEP_KERNEL_INCLUDE_DIRS}"
                              SKIP_PRECOMPILE_HEADERS ON)
  get_target_property(type ${target} TYPE)
  if(type STREQUAL "STATIC_LIBRARY")
    # Nothing refers to the registration, so a linker would leave it out of a program.
    target_link_options(${target} INTERFACE "SHELL:-u lockstep_kernel_${arg_NAME}")
  endif()
endfunction()
