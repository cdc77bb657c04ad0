#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds every fuzzer of this folder and runs it.
#   run.sh smoke          earlier findings (tests/fuzz/found) and a fixed number of inputs from a fixed seed: 20000,
#                         or what the fuzzer's file says (// smoke: 2000)
#   run.sh SECONDS        as long, from a new seed, on top of what earlier runs learnt (build/fuzz/corpus)
# New findings are kept in build/fuzz/found.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
budget=${1:-smoke}
build=$root/build/fuzz

test -e "$build/build.ninja" ||
    cmake -S "$root" -B "$build" -G Ninja -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ -DOLS_SANITIZE=ON \
        -DOLS_TESTS=OFF -DOLS_FUZZ=ON >/dev/null
mapfile -t fuzzers < <(cd "$root/tests/fuzz" && ls fuzz_*.cpp | sed 's/\.cpp$//')
ninja -C "$build" --quiet "${fuzzers[@]}"
mkdir -p "$build/found"

# run FUZZER ARGUMENT...: quiet unless it finds something
run() {
    local fuzzer=$1 log=$build/$1.log
    shift
    if ! "$build/bin/$fuzzer" -timeout=10 -artifact_prefix="$build/found/$fuzzer-" "$@" >"$log" 2>&1; then
        cat "$log"
        echo "$fuzzer found something: run build/fuzz/bin/$fuzzer on the file it names above" >&2
        exit 1
    fi
}

for fuzzer in "${fuzzers[@]}"; do
    shopt -s nullglob
    findings=("$root/tests/fuzz/found/$fuzzer-"*)
    if ((${#findings[@]})); then run "$fuzzer" "${findings[@]}"; fi
    if [[ $budget == smoke ]]; then
        runs=$(sed -n 's|^// smoke: ||p' "$root/tests/fuzz/$fuzzer.cpp")
        run "$fuzzer" -seed=1 -runs="${runs:-20000}"
    else
        mkdir -p "$build/corpus/$fuzzer"
        run "$fuzzer" -max_total_time="$budget" "$build/corpus/$fuzzer"
    fi
    echo "$fuzzer: $(sed -n 's/^Done \([0-9]*\) runs.*/\1 runs/p' "$build/$fuzzer.log"), ${#findings[@]} earlier findings"
done
