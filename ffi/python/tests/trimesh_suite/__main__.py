"""Runs trimesh's ray tests, of its source distribution, on Twincast: `python trimesh_suite intersector|shim TESTS`."""

import sys
from pathlib import Path

import pytest

#: What stands on files that the source distribution does not have, and nothing can stand for.
LEFT_OUT = ["test_rays", "test_on_edge"]


def main(how: str, tests: str) -> int:
    if how == "shim":
        from twincast.compat import embreex

        embreex.install()
    import trimesh
    from trimesh.ray import ray_pyembree

    import twincast

    if how == "intersector":
        ray_pyembree.RayMeshIntersector = twincast.RayMeshIntersector
    mesh = trimesh.creation.box(use_embree=True)
    expected = twincast.RayMeshIntersector if how == "intersector" else ray_pyembree.RayMeshIntersector
    assert type(mesh.ray) is expected
    assert how != "shim" or type(mesh.ray._scene.scene).__module__.startswith("twincast.")
    sys.path.insert(0, str(Path(__file__).parent))
    files = [str(Path(tests) / name) for name in ("test_ray.py", "test_ray_upstream.py")]
    left_out = " and ".join(f"not {name}" for name in LEFT_OUT)
    # Theirs is a package of tests: their own `generic` must not be found before ours.
    return pytest.main(["-q", "-p", "no:cacheprovider", "--import-mode=importlib", "--rootdir", tests, "-c", "/dev/null", "-k", left_out, *files])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
