#!/bin/sh
# Runs every fuzz target, or those named, for FUZZ_SECONDS each and FUZZ_JOBS at a time. What is found lies in target/fuzz/found.
set -eu
seconds=${FUZZ_SECONDS:-600}

if [ "${1:-}" = --one ]; then
    name=$2
    mkdir -p "$FUZZ_FOLDER/corpus/$name"
    # Writes seeds and words.
    FUZZ_TARGET=$name "$GUIDED" -runs=0 >/dev/null 2>&1
    log=$FUZZ_FOLDER/$name.log
    FUZZ_TARGET=$name "$GUIDED" "$FUZZ_FOLDER/corpus/$name" "$FUZZ_FOLDER/seeds/$name" -dict="$FUZZ_FOLDER/$name.dict" \
        -max_total_time="$seconds" -max_len=16384 -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 \
        -artifact_prefix="$FUZZ_FOLDER/$name-" >"$log" 2>&1 && failed=0 || failed=1
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    [ $failed = 0 ] && echo "$name: $runs runs in $seconds s" || echo "$name: FAILED after ${runs:-?} runs, see $log" >&2
    exit $failed
fi

cd "$(dirname "$0")/.."
host=$(rustc -vV | sed -n 's/^host: //p')
export CARGO_TARGET_DIR="${FUZZ_TARGET_DIR:-$PWD/target/fuzz}"
# Coverage as libFuzzer wants it; with a target given, build scripts are built without.
coverage="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters"
coverage="$coverage -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing"
RUSTFLAGS="$coverage" ${CARGO:-cargo} build --locked --profile fuzz --target "$host" -p cager-fuzz --features guided --bin guided
export GUIDED="$CARGO_TARGET_DIR/$host/fuzz/guided" FUZZ_FOLDER="$CARGO_TARGET_DIR/found"
targets=${*:-$(FUZZ_TARGET='' "$GUIDED" 2>&1 | sed -n 's/^set FUZZ_TARGET to one of //p')}
echo "$targets" | tr ' ' '\n' | xargs -P "${FUZZ_JOBS:-$(nproc)}" -I '{}' sh "$PWD/fuzz/run.sh" --one '{}'
