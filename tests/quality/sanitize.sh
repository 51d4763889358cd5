#!/bin/sh
# Builds with the address and undefined-behaviour sanitizers and runs the quick tests by one instruction set.
# SPDX-License-Identifier: Apache-2.0
set -e
cd "$(dirname "$0")/../.."
cmake --preset sanitize "$@"
cmake --build --preset sanitize
LOCKSTEP_TARGET=${LOCKSTEP_TARGET:-baseline} ctest --preset sanitize
