#!/usr/bin/env bash
# Builds the wheel for this machine, installs it, and runs the package's tests; arguments go to pytest.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/wheel.sh --local
venv=$(scripts/python-environment.sh)
wheel=$(ls -t target/wheels/twincast-*-linux_*.whl | head -1)
"$venv/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
cd ffi/python
exec "$venv/bin/python" -m pytest -q "$@"
