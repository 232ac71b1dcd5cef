#!/usr/bin/env bash
# Runs the decoder where there is nothing: conformance vectors in emulators, and the proof that no panic can be reached.
#
#   ./check.sh                 every target; writes results.md
#   ./check.sh --quick         Cortex-M3 and the proof for it
#   ./check.sh --allow-skip    what lacks its tools is skipped loudly instead of failing
#
# A compiler with the sources of its core library is needed. Debian's packages rustc-web and rust-web-src are such a pair; a
# rustup toolchain with rust-src serves too: RUSTC=$(rustup which rustc) ./check.sh
set -euo pipefail
cd "$(dirname "$0")"
quick=""; allow_skip=""
for argument in "$@"; do
    case $argument in
        --quick) quick=1 ;;
        --allow-skip) allow_skip=1 ;;
        *) echo "unknown: $argument" >&2; exit 1 ;;
    esac
done

failed=0
skip() {
    echo "SKIPPED: $*" >&2
    if [ -z "$allow_skip" ]; then failed=1; fi
}
install() {
    if command -v apt-get >/dev/null && { [ "$(id -u)" = 0 ] || command -v sudo >/dev/null; }; then
        local sudo=""; if [ "$(id -u)" != 0 ]; then sudo=sudo; fi
        $sudo apt-get update -qq >/dev/null 2>&1 || true
        $sudo apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1 || true
    fi
}
need() {
    command -v "$1" >/dev/null || install "${@:2}"
    command -v "$1" >/dev/null
}

export RUSTC=${RUSTC:-/usr/bin/rustc}
sources() { [ -d "$("$RUSTC" --print sysroot 2>/dev/null)/lib/rustlib/src/rust/library" ]; }
if ! sources; then install rustc-web rust-web-src; fi
if ! sources; then
    skip "NO COMPILER WITH THE SOURCES OF ITS CORE LIBRARY (rustc-web AND rust-web-src, OR rustup component add rust-src): NOTHING OF FIRMWARE WAS RUN"
    exit $failed
fi
# Sources of core are built with it; the decoder itself uses stable features alone.
export RUSTC_BOOTSTRAP=1
if ! need ld.lld-22 lld-22 && ! command -v ld.lld >/dev/null; then skip "NO ld.lld: NOTHING OF FIRMWARE WAS RUN"; exit $failed; fi
linker=$(command -v ld.lld-22 || command -v ld.lld)
objdump=$(command -v llvm-objdump-22 || command -v llvm-objdump || true)

# build TARGET OPT BIN [cargo arguments]: prints the program's path, or nothing if it does not build.
build() {
    local target=$1 opt=$2 bin=$3; shift 3
    local folder=target/opt-$opt variable
    variable=CARGO_TARGET_$(echo "$target" | tr 'a-z-' 'A-Z_')_LINKER
    # With a system below it core expects that system's memory functions; there are none here.
    local features=(); case $target in *linux*) features=(-Zbuild-std-features=compiler-builtins-mem) ;; esac
    env "$variable=$linker" CARGO_PROFILE_RELEASE_OPT_LEVEL="$opt" cargo build --quiet --release --target "$target" -Zbuild-std=core "${features[@]}" \
        --target-dir "$folder" --bin "$bin" "$@" 2>"$folder.log" || { grep -o 'undefined symbol: .*' "$folder.log" | head -1 >&2 || cat "$folder.log" >&2; return 1; }
    echo "$folder/$target/release/$bin"
}
text_of() { size -A "$1" | awk '$1 == ".text" { print $2 }'; }

mkdir -p target
results=target/results.md
{
    echo "# Results"
    echo
    echo "Made by \`check.sh\`: $("$RUSTC" --version | cut -d' ' -f1,2), $(qemu-system-arm --version 2>/dev/null | head -1 | cut -d'(' -f1 || true)."
    echo
    echo "| machine | vectors | outcome |"
    echo "|---|---|---|"
} > $results

# run NAME TARGET COMMAND...: the vectors in an emulator.
run() {
    local name=$1 target=$2; shift 2
    local program output
    program=$(build "$target" s vectors) || { echo "FAILED: $name does not build" >&2; failed=1; return; }
    output=$("$@" "$program" 2>&1 </dev/null) && code=0 || code=$?
    echo "== $name"; echo "$output"
    if [ $code != 0 ]; then echo "FAILED: $name, exit code $code" >&2; failed=1; fi
    echo "| $name, \`$target\` | $(echo "$output" | sed -n 's/^right //p') of $(echo "$output" | sed -n 's/^vectors //p') | $(echo "$output" | tail -1) |" >> $results
    measured=$output
}

if need qemu-system-arm qemu-system-arm; then
    emulate() { qemu-system-arm -machine "$1" -nographic -monitor none -serial none -icount shift=8 -semihosting-config enable=on,target=native -kernel "$2"; }
    run "Cortex-M3 (MPS2 AN385)" thumbv7m-none-eabi emulate mps2-an385
    m3=$measured
    if [ -z "$quick" ]; then
        run "Cortex-M0's instructions (on the M3)" thumbv6m-none-eabi emulate mps2-an385
        run "Cortex-M4F (MPS2 AN386)" thumbv7em-none-eabihf emulate mps2-an386
    fi
else
    skip "NO qemu-system-arm: CORTEX-M WAS NOT RUN"
    m3=""
fi
if [ -z "$quick" ]; then
    if need qemu-system-riscv32 qemu-system-misc; then
        virt() { qemu-system-riscv32 -M virt -bios none -nographic -kernel "$1"; }
        run "RISC-V RV32IMC (virt)" riscv32imc-unknown-none-elf virt
    else
        skip "NO qemu-system-riscv32: RISC-V WAS NOT RUN"
    fi
    if need qemu-armeb qemu-user; then
        run "ARM big-endian, 32 bits (Linux calls)" armebv7r-none-eabi qemu-armeb
    else
        skip "NO qemu-armeb: NO BIG-ENDIAN MACHINE WAS RUN"
    fi
    itself() { "$1"; }
    if [ "$(uname -m)" = x86_64 ]; then
        export CARGO_TARGET_I686_UNKNOWN_LINUX_GNU_RUSTFLAGS="-Clinker-flavor=ld.lld -Crelocation-model=static -Ctarget-feature=+crt-static -Cpanic=abort"
        run "x86, 32 bits (Linux calls)" i686-unknown-linux-gnu itself
    fi
    if command -v node >/dev/null && { command -v wasm-ld-22 >/dev/null || command -v wasm-ld >/dev/null; }; then
        (cd wasm && CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(command -v wasm-ld-22 || command -v wasm-ld) cargo build --quiet --release --target wasm32-unknown-unknown -Zbuild-std=core)
        output=$(node wasm/run.mjs wasm/target/wasm32-unknown-unknown/release/selvedge_wasm.wasm ../spec/vectors) && code=0 || code=$?
        echo "== WebAssembly"; echo "$output"
        if [ $code != 0 ]; then failed=1; fi
        echo "| WebAssembly (node) | $(echo "$output" | sed -n 's/^right //p') of $(echo "$output" | sed -n 's/^vectors //p') | $(echo "$output" | tail -1) |" >> $results
    else
        skip "NO node OR NO wasm-ld: WEBASSEMBLY WAS NOT RUN"
    fi
fi

echo "== no panic, proved by the linker"
{ echo; echo "## No panic"; echo; echo "Every public entry is linked with a panic handler that calls a function which does not exist. \"Links\" means that none can panic."; echo; echo "| target | optimised for | outcome | with a planted panic |"; echo "|---|---|---|---|"; } >> $results
targets="thumbv7m-none-eabi thumbv6m-none-eabi"; opts="s z 2 3"
if [ -n "$quick" ]; then targets=thumbv7m-none-eabi; opts=s; fi
for target in $targets; do
    for opt in $opts; do
        outcome="**does not link**"
        if build "$target" "$opt" proof --features proof >/dev/null; then outcome=links; else failed=1; fi
        planted="**links**"
        if ! build "$target" "$opt" proof --features proof,planted >/dev/null 2>&1; then planted="does not link"; else echo "FAILED: A PLANTED PANIC WAS NOT FOUND" >&2; failed=1; fi
        echo "$target, $opt: $outcome; with a planted panic $planted"
        echo "| \`$target\` | $opt | $outcome | $planted |" >> $results
    done
done

if [ -z "$quick" ] && [ -n "$objdump" ]; then
    { echo; echo "## Code and stack"; echo; echo "Bytes of code and constants on \`thumbv7m-none-eabi\`, with one method alone: the whole program with \`open\` and every check, what sampling reaches, what \`open\` reaches."; echo; echo "| method | optimised for | whole | sampling | \`open\` |"; echo "|---|---|---:|---:|---:|"; } >> $results
    # The methods are those that the core lists.
    methods=$(sed -n 's/^all-methods = \[\(.*\)\]/\1/p' ../decoder-core/Cargo.toml | tr -d '",')
    for method in $methods; do for opt in s z 2; do
        program=$(build thumbv7m-none-eabi "$opt" size --no-default-features --features "selvedge/$method")
        echo "| $method | $opt | $(text_of "$program") | $(python3 reachable.py "$program" sample_material "$objdump" | cut -d' ' -f1) | $(python3 reachable.py "$program" open_material "$objdump" | cut -d' ' -f1) |" >> $results
    done; done
    { echo; echo "Measured in the emulator (Cortex-M3, optimised for size):"; echo; echo '```'; echo "$m3" | grep -E 'stack|instructions'; echo '```'; } >> $results
    cp $results results.md
    cat results.md
fi
exit $failed
