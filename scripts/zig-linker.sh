#!/usr/bin/env bash
# Links for glibc 2.28, whose symbols zig knows: cargo's linker where scripts/wheel.sh says so. ZIG is the python that has the package ziglang.
# Arguments that only GNU's linker has, and libgcc's that zig brings itself, are left out.
set -euo pipefail
arguments=()
for argument in "$@"; do
    case $argument in
        -lgcc_s) arguments+=(-lunwind) ;;
        -Wl,--no-undefined-version | -Wl,-O1 | -Wl,--disable-new-dtags | -m64) ;;
        *) arguments+=("$argument") ;;
    esac
done
exec "$ZIG" -m ziglang cc -target "$(uname -m)-linux-gnu.2.28" "${arguments[@]}"
