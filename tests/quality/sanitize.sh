#!/bin/sh
# Builds with the address and undefined-behaviour sanitizers and runs, by the baseline's instructions, the tests of units,
# of the contract, of files, of the command and of the C interface. What is left out compares the same kernels with theory
# and with the reference, for hours under sanitizers. SPDX-License-Identifier: Apache-2.0
set -e
cd "$(dirname "$0")/../.."
cmake --preset sanitize -DLOCKSTEP_TARGETS= "$@"
cmake --build --preset sanitize --target unit_programs contract_programs fuzz_programs tool_programs c_consumer
LOCKSTEP_TARGET=baseline ctest --preset sanitize -L '^(unit|contract|fuzz|tool|c)$' \
  -E '^(generated_test|ranks.mpi.*|c.abi)$'
