#!/bin/sh
# Builds everything with clang, warnings are errors, benchmarks and slow tests too, and runs the quick tests.
# SPDX-License-Identifier: Apache-2.0
set -e
cd "$(dirname "$0")/../.."
cmake -S . -B build/clang -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=clang++ "$@"
cmake --build build/clang --target all slow_programs
ctest --test-dir build/clang -j 2 -LE '^slow$' --output-on-failure
