#!/usr/bin/env bash
# Damages valid vectors and holds the naive decoder against this one: same rule, file, offset and number, or same digest.
#   fuzz/naive.sh COUNT [SEED]
set -euo pipefail
cd "$(dirname "$0")/.."
count=${1:?number of files}; seed=${2:-1}
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cargo run --quiet --release -p selvedge-tests --bin damaged -- "$folder" "$count" "$seed"
cargo run --quiet --release --bin selvedge -- conform "$folder" -- python3 spec/naive/selvedge_naive.py serve
