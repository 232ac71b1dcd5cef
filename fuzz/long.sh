#!/usr/bin/env bash
# Every target for so many seconds; appends executions, edges and the execution of the last new edge to ledger.tsv.
#   fuzz/long.sh SECONDS [TARGET...]
set -euo pipefail
cd "$(dirname "$0")"
seconds=${1:?seconds for each target}; shift
targets=("$@"); if [ ${#targets[@]} = 0 ]; then targets=(open prefix mutate generate paths importers options); fi
cargo +nightly fuzz build -O
for target in "${targets[@]}"; do
    mkdir -p "corpus/$target" "artifacts/$target"
    log=target/$target.log
    more=(); if [ "$target" = open ]; then more=(../spec/vectors/valid ../spec/vectors/invalid); fi
    cargo +nightly fuzz run -O "$target" "corpus/$target" "seeds/$target" "${more[@]}" -- -max_total_time="$seconds" -max_len=65536 -print_final_stats=1 \
        >"$log" 2>&1 || { echo "$target: FAILED, see artifacts/$target and $log"; tail -5 "$log"; exit 1; }
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    edges=$(grep -o 'cov: [0-9]*' "$log" | tail -1 | cut -d' ' -f2)
    # The first line with the final number of edges is where the last new one was found.
    last=$(grep -m1 "cov: $edges " "$log" | sed 's/^#\([0-9]*\).*/\1/')
    printf '%s\t%s\t%s\t%s\t%s\n' "$target" "$seconds" "$executions" "$edges" "$last" | tee -a ledger.tsv
done
