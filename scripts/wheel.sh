#!/usr/bin/env bash
# Builds the wheel of the Python package into target/wheels: for any Linux since Debian 10 (manylinux_2_28), with zig as the linker, which
# knows that system's symbols. `--local` builds for this machine's system instead, and needs no zig.
set -euo pipefail
cd "$(dirname "$0")/.."
arguments=(--release --manifest-path ffi/python/Cargo.toml --out target/wheels --profile foreign)
arguments=("${arguments[@]:1}")
if [ "${1:-}" = --local ]; then
    venv=$(scripts/python-environment.sh)
    arguments+=(--compatibility linux)
else
    venv=$(scripts/python-environment.sh ziglang==0.15.1)
    arguments+=(--compatibility manylinux_2_28 --zig)
    # cargo-zigbuild names the linker per target, so that the target must be named.
    arguments+=(--target "$(rustc -vV | sed -n 's/^host: //p')")
fi
PATH="$venv/bin:$PATH" "$venv/bin/maturin" build "${arguments[@]}"
