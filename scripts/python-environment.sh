#!/usr/bin/env bash
# Makes target/python, a virtual environment with what the Python package is built and tested with, and prints its path.
# PYTHON chooses the interpreter.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=$PWD/target/python
packages=(maturin==1.16.0 numpy pytest trimesh==5.2.0 rtree scipy embreex==4.4.0.post1 "$@")
stamp="${packages[*]}"
if [ "$(cat "$venv/.packages" 2>/dev/null)" != "$stamp" ]; then
    python=${PYTHON:-python3}
    [ -x "$venv/bin/pip" ] || "$python" -m venv "$venv" >&2 || {
        echo "python-environment.sh: $python has no venv; on Debian install python3-venv" >&2
        exit 1
    }
    # embreex and rtree are compared with where they have a wheel for this machine.
    "$venv/bin/pip" install --quiet --disable-pip-version-check "${packages[@]}" >&2 ||
        "$venv/bin/pip" install --quiet --disable-pip-version-check maturin==1.16.0 numpy pytest trimesh==5.2.0 scipy "$@" >&2
    printf '%s' "$stamp" >"$venv/.packages"
fi
echo "$venv"
