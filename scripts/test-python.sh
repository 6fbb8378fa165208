#!/usr/bin/env bash
# Builds the Python package's wheel for this machine, installs it in an environment of its own, and runs its tests, trimesh's ray tests among
# them. Arguments go to pytest. Where Open3D is installed there (OPEN3D=1 installs it), it is compared with.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/wheel.sh --local
venv=$(scripts/python-environment.sh)
if [ -n "${OPEN3D:-}" ]; then
    "$venv/bin/pip" install --quiet --disable-pip-version-check open3d
fi
wheel=$(ls -t target/wheels/twincast-*-linux_*.whl | head -1)
"$venv/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"

# trimesh's tests are in its source distribution alone.
suite=$PWD/target/trimesh-5.2.0
if [ ! -d "$suite/tests" ]; then
    "$venv/bin/pip" download --quiet --disable-pip-version-check --no-deps --no-binary :all: --dest target trimesh==5.2.0
    tar -xzf target/trimesh-5.2.0.tar.gz -C target
fi
cd ffi/python
TWINCAST_TRIMESH_TESTS="$suite/tests" exec "$venv/bin/python" -m pytest -q -rs "$@" tests ../../docs/PYTHON.md
