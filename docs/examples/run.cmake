# Runs PROGRAM and compares what it prints with the file EXPECTED. SPDX-License-Identifier: Apache-2.0
cmake_minimum_required(VERSION 3.22)
execute_process(COMMAND ${PROGRAM} OUTPUT_VARIABLE printed COMMAND_ERROR_IS_FATAL ANY)
file(READ ${EXPECTED} expected)
if(NOT printed STREQUAL expected)
  message(FATAL_ERROR "printed\n${printed}expected\n${expected}")
endif()
