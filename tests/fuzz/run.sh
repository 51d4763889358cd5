#!/bin/sh
# Builds the fuzz targets by clang, under the sanitizers, and runs each for some time. What they find is in
# build/fuzz/finds, and becomes a test.
#   tests/fuzz/run.sh [SECONDS for each, 600] [TARGET ...]                         SPDX-License-Identifier: Apache-2.0
cd "$(dirname "$0")/../.." || exit 1
command -v clang++ >/dev/null || { echo "skipped: there is no clang++ (Debian: clang libclang-rt-14-dev)"; exit 0; }
seconds=${1:-600}; [ $# -gt 0 ] && shift
targets=${*:-urdf mjcf mesh save csv calls step}
out=build/fuzz
cmake --preset fuzz >/dev/null && cmake --build --preset fuzz --target fuzz || exit 1
mkdir -p $out/finds
# The words of the formats, which the fuzzer mixes in.
cat src/import/urdf/*.cpp | grep -oE '"[a-z_]{3,20}"' | sort -u >$out/urdf.dict
cat src/import/mjcf/*.cpp | grep -oE '"[a-z0-9_]{3,20}"' | sort -u >$out/mjcf.dict
status=0
printf '| target | executions | edges | features | finds |\n| --- | ---: | ---: | ---: | ---: |\n'
for target in $targets; do
  mkdir -p $out/corpus/$target
  seeds=tests/fuzz/corpus/$target; words=
  case $target in
    urdf) seeds=tests/models; words=-dict=$out/urdf.dict ;;
    mjcf) seeds=tests/mjcf/models; words=-dict=$out/mjcf.dict ;;
  esac
  for folder in $seeds; do [ -d "$folder" ] && existing="$existing $folder"; done
  $out/tests/fuzz/fuzz_$target $out/corpus/$target $existing $words -max_total_time="$seconds" -timeout=30 -max_len=20000 \
    -rss_limit_mb=3000 -artifact_prefix=$out/finds/$target- -print_final_stats=1 >$out/$target.log 2>&1 || status=1
  existing=
  last=$(grep -E 'cov: [0-9]+' $out/$target.log | tail -1)
  printf '| %s | %s | %s | %s | %s |\n' "$target" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' $out/$target.log)" \
    "$(echo "$last" | sed -n 's/.*cov: \([0-9]*\).*/\1/p')" "$(echo "$last" | sed -n 's/.*ft: \([0-9]*\).*/\1/p')" \
    "$(find $out/finds -name "$target-*" | wc -l)"
done
exit $status
