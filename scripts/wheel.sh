#!/usr/bin/env bash
# Builds the Python package's wheel into target/wheels, for CPython 3.9 and later: for any Linux as old as Debian 10 (manylinux_2_28), linked by
# zig, which knows that system's symbols. `--local` builds for this machine's system instead, without zig. Another linker
# has cargo compile everything once more.
#
# WHEEL_PROFILE=dev builds a slower package with every debug assertion, on what the tests without default features are compiled with:
# after `make check` nothing but the package is left to compile for this machine.
set -euo pipefail
cd "$(dirname "$0")/.."
arguments=(build --manifest-path ffi/python/Cargo.toml --out target/wheels --strip)
case "${WHEEL_PROFILE:-foreign}" in
    foreign) ;;
    dev) arguments+=(--profile dev --features beside-tests) ;;
    *)
        echo "WHEEL_PROFILE=$WHEEL_PROFILE: neither foreign nor dev" >&2
        exit 2
        ;;
esac
if [ "${1:-}" = --local ]; then
    venv=$(scripts/python-environment.sh)
    arguments+=(--compatibility linux)
else
    venv=$(scripts/python-environment.sh ziglang==0.15.1)
    arguments+=(--compatibility manylinux_2_28)
    host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
    export ZIG=$venv/bin/python "CARGO_TARGET_${host}_LINKER=$PWD/scripts/zig-linker.sh"
fi
# An older wheel must not be taken for this one.
rm -f target/wheels/twincast-*.whl
PATH="$venv/bin:$PATH" maturin "${arguments[@]}"
