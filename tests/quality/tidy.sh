#!/bin/sh
# clang-tidy by .clang-tidy over all sources of the library; with --quick over a few that include nearly all headers.
#   tests/quality/tidy.sh [--quick] [FOLDER to configure in]                         SPDX-License-Identifier: Apache-2.0
cd "$(dirname "$0")/../.." || exit 1
command -v clang-tidy >/dev/null || { echo "skipped: there is no clang-tidy (Debian: clang-tidy)"; exit 0; }
quick=; [ "$1" = --quick ] && { quick=1; shift; }
build=${1:-build}/tidy
# Its own commands: precompiled headers of one compiler are nothing to another.
cmake -S . -B "$build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DLOCKSTEP_BUILD_TESTS=OFF \
  -DLOCKSTEP_BUILD_BENCH=OFF -DLOCKSTEP_VIEWER=OFF >"$build.log" 2>&1 || { cat "$build.log"; exit 1; }
# The files as they are compiled: those that are compiled as one are read as one, for a third of the time. Of the kernels,
# which are one source, one instruction set; nothing that the reference alone has.
files=$(sed -n 's/^ *"file": "\(.*\)".*/\1/p' "$build"/compile_commands.json | sort -u |
  grep -E '/src/' | grep -vE '/src/reference/|/python/src/|/targets/(avx512|baseline)\.cpp$')
[ "$quick" ] && files="src/model/validate.cpp src/jit/schedule.cpp"
echo "$files" | tr ' ' '\n' | xargs -P "$(nproc)" -n 1 clang-tidy --quiet --extra-arg=-Qunused-arguments -p "$build" >"$build.out" 2>&1
grep -E 'warning:|error:' "$build.out" | sort -u
! grep -qE 'warning:|error:' "$build.out"
