#!/bin/sh
# Builds with the thread sanitizer, and with plain threads in place of oneTBB (threads/tbb/threads.h says why), and runs
# what tests threads and batches that are used at once, and of determinism and savepoints one method. SPDX-License-Identifier: Apache-2.0
set -e
cd "$(dirname "$0")/../.."
cmake -S . -B build/threads -G Ninja -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" \
  -DCMAKE_CXX_FLAGS="-fsanitize=thread -I$PWD/tests/quality/threads -DLOCKSTEP_SANITIZED" \
  -DLOCKSTEP_TARGETS= -DLOCKSTEP_COMPILED=OFF \
  -DLOCKSTEP_BUILD_BENCH=OFF -DLOCKSTEP_BUILD_PYTHON=OFF -DLOCKSTEP_BUILD_TOOL=OFF -DLOCKSTEP_INSTALL=OFF "$@"
cmake --build build/threads --target contract_test
TSAN_OPTIONS="halt_on_error=1 second_deadlock_stack=1" build/threads/tests/contract_test --gtest_brief=1 \
  --gtest_filter='Threads*:InUse*:*in_use*:*Determinism.thread_count*/reduced:*/Save.*/reduced'
