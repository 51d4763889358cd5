#!/bin/sh
# Builds the fuzz targets by clang, under the sanitizers, and runs each for some time. Prints a page with what the last
# runs of each target have done, which docs/results/fuzz.md keeps. What they find is in build/fuzz/finds, and becomes a
# test.
#   tests/fuzz/run.sh [SECONDS for each, 600] [TARGET ...]                         SPDX-License-Identifier: Apache-2.0
cd "$(dirname "$0")/../.." || exit 1
command -v clang++ >/dev/null || { echo "skipped: there is no clang++ (Debian: clang libclang-rt-14-dev)"; exit 0; }
seconds=${1:-600}; [ $# -gt 0 ] && shift
all="urdf mjcf mesh save csv calls step"
targets=${*:-$all}
out=build/fuzz
cmake --preset fuzz >/dev/null && cmake --build --preset fuzz --target fuzz >$out/build.log 2>&1 || { cat $out/build.log; exit 1; }
mkdir -p $out/finds $out/rows
# The words of the formats, which the fuzzer mixes in.
cat src/import/urdf/*.cpp | grep -oE '"[a-z_]{3,20}"' | sort -u >$out/urdf.dict
cat src/import/mjcf/*.cpp | grep -oE '"[a-z0-9_]{3,20}"' | sort -u >$out/mjcf.dict
status=0
for target in $targets; do
  echo "$target ..." >&2
  mkdir -p $out/corpus/"$target"
  seeds=tests/fuzz/corpus/$target; words=
  case $target in
    urdf) seeds=tests/models; words=-dict=$out/urdf.dict ;;
    mjcf) seeds=tests/mjcf/models; words=-dict=$out/mjcf.dict ;;
    step)  # short inputs are models of one link
      words=-len_control=0
      [ -f $out/corpus/step/first64 ] || for i in $(seq 64); do head -c 400 /dev/urandom >$out/corpus/step/first"$i"; done ;;
  esac
  [ -d "$seeds" ] || seeds=
  $out/tests/fuzz/fuzz_"$target" $out/corpus/"$target" $seeds $words -max_total_time="$seconds" -timeout=30 \
    -max_len=20000 -rss_limit_mb=3000 -artifact_prefix=$out/finds/"$target"- -print_final_stats=1 \
    >$out/"$target".log 2>&1 || status=1
  last=$(grep -E 'cov: [0-9]+' $out/"$target".log | tail -1)
  printf '| %s | %s | %s | %s | %s | %s | %s |\n' "$target" "$seconds" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' $out/"$target".log)" \
    "$(echo "$last" | sed -n 's/.*cov: \([0-9]*\).*/\1/p')" "$(echo "$last" | sed -n 's/.*ft: \([0-9]*\).*/\1/p')" \
    "$(find $out/finds -name "$target-*" | wc -l)" "$(git rev-parse --short HEAD), $(date +%F)" >$out/rows/"$target"
done
cat <<'PAGE'
# Results: fuzz targets

This page is what `tests/fuzz/run.sh` prints. Do not edit it. [reliability](../reliability.md#fuzzing) says what the
targets do. Edges and features are libFuzzer's counts of what the inputs have reached. A find is an input that ends the
program, or takes more than 30 s or 3 GB.

| target | seconds | executions | edges | features | finds | commit, day |
| --- | ---: | ---: | ---: | ---: | ---: | --- |
PAGE
for target in $all; do [ -f $out/rows/"$target" ] && cat $out/rows/"$target"; done
exit $status
