#!/usr/bin/env bash
# Makes target/python, a virtual environment with what the Python package is built and tested with, and prints its path.
# PYTHON chooses the interpreter; more packages may be named. What is only compared with (embreex, manifold3d) is left out where it has
# no wheel for this machine, and then the tests say so.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=$PWD/target/python
needed=(maturin==1.16.0 numpy pytest trimesh==5.2.0 scipy "$@")
compared=(rtree embreex==4.4.0.post1 manifold3d)
stamp="${needed[*]} ${compared[*]}"
if [ "$(cat "$venv/.packages" 2>/dev/null)" != "$stamp" ]; then
    if [ ! -x "$venv/bin/pip" ]; then
        python=${PYTHON:-python3}
        "$python" -c 'import ensurepip, venv' 2>/dev/null || scripts/install-packages.sh python3-venv >&2
        "$python" -m venv "$venv" >&2
    fi
    install() {
        "$venv/bin/pip" install --quiet --disable-pip-version-check "$@" >&2
    }
    install "${needed[@]}"
    for package in "${compared[@]}"; do
        install --only-binary :all: "$package" || echo "python-environment.sh: without $package" >&2
    done
    printf '%s' "$stamp" >"$venv/.packages"
fi
echo "$venv"
