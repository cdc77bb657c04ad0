#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds every fuzzer of this folder and runs each for some seconds (default 5). Findings are kept in build/fuzz/found.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
seconds=${1:-5}
build=$root/build/fuzz

test -e "$build/build.ninja" ||
    cmake -S "$root" -B "$build" -G Ninja -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ -DOLS_SANITIZE=ON \
        -DOLS_TESTS=OFF -DOLS_FUZZ=ON >/dev/null
mapfile -t fuzzers < <(cd "$root/tests/fuzz" && ls fuzz_*.cpp | sed 's/\.cpp$//')
ninja -C "$build" --quiet "${fuzzers[@]}"
mkdir -p "$build/found"
for fuzzer in "${fuzzers[@]}"; do
    mkdir -p "$build/corpus/$fuzzer"
    log=$build/$fuzzer.log
    if ! "$build/bin/$fuzzer" -max_total_time="$seconds" -timeout=10 -artifact_prefix="$build/found/$fuzzer-" \
        "$build/corpus/$fuzzer" >"$log" 2>&1; then
        cat "$log"
        echo "$fuzzer found something: run build/fuzz/bin/$fuzzer on the file it names above" >&2
        exit 1
    fi
    echo "$fuzzer: $(sed -n 's/^Done \([0-9]*\) runs.*/\1 runs/p' "$log")"
done
