#!/usr/bin/env bash
# Every target for so many executions; appends executions, edges and the execution of the last new edge to ledger.tsv.
#   fuzz/long.sh EXECUTIONS [TARGET...]
# Without AddressSanitizer, which makes a target six to twenty times slower: no crate of this repository that a target runs may have unsafe code, so it would
# look at dependencies alone. SANITIZER=address turns it on.
set -euo pipefail
cd "$(dirname "$0")"
executions=${1:?executions of each target}; shift
sanitizer=${SANITIZER:-none}
targets=("$@"); if [ ${#targets[@]} = 0 ]; then targets=(open prefix mutate generate paths importers btf archive pixels options); fi
cargo +nightly fuzz build -O -s "$sanitizer"
for target in "${targets[@]}"; do
    mkdir -p "corpus/$target" "artifacts/$target"
    log=target/$target.log
    more=(); if [ "$target" = open ]; then more=(../spec/vectors/valid ../spec/vectors/invalid); fi
    cargo +nightly fuzz run -O -s "$sanitizer" "$target" "corpus/$target" "seeds/$target" "${more[@]}" -- -runs="$executions" -max_len=65536 -print_final_stats=1 \
        >"$log" 2>&1 || { echo "$target: FAILED, see artifacts/$target and $log"; tail -5 "$log"; exit 1; }
    run=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    edges=$(grep -o 'cov: [0-9]*' "$log" | tail -1 | cut -d' ' -f2)
    # The first line with the final number of edges is where the last new one was found.
    last=$(grep -m1 "cov: $edges " "$log" | sed 's/^#\([0-9]*\).*/\1/')
    printf '%s\t%s\t%s\t%s\t%s\n' "$target" "$sanitizer" "$run" "$edges" "$last" | tee -a ledger.tsv
done
