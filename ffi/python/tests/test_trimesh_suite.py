"""trimesh's own ray tests, from its source distribution, on both ways in.

Where that lies, `TWINCAST_TRIMESH_TESTS` says: the folder `tests` of trimesh-5.2.0.tar.gz.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("how", ["intersector", "shim"])
def test_trimesh_ray_tests(how):
    pytest.importorskip("trimesh")
    tests = os.environ.get("TWINCAST_TRIMESH_TESTS")
    if not tests:
        pytest.skip("TWINCAST_TRIMESH_TESTS is not set")
    suite = Path(__file__).parent / "trimesh_suite"
    done = subprocess.run([sys.executable, str(suite), how, tests], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    print(done.stdout)
