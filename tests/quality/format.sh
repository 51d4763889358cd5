#!/bin/sh
# Checks that all C++ is laid out as .clang-format says; with --fix lays it out. SPDX-License-Identifier: Apache-2.0
cd "$(dirname "$0")/../.." || exit 1
command -v clang-format >/dev/null || { echo "skipped: there is no clang-format (Debian: clang-format)"; exit 0; }
files=$(find include src tests bench docs python -name '*.h' -o -name '*.cpp')
case "$1" in
  --fix) echo "$files" | xargs clang-format -i ;;
  *) echo "$files" | xargs clang-format --dry-run --Werror ;;
esac
