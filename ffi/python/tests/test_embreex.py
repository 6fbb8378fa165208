"""The stand-in for embreex; and embreex itself, where it is installed."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

from twincast.compat import embreex as ours

TRIANGLE = (np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.int32([[0, 1, 2]]))


@pytest.fixture
def theirs():
    real = pytest.importorskip("embreex", reason="embreex is not there to compare with")
    from embreex import mesh_construction, rtcore_scene  # noqa: F401

    return real


def build(package, make):
    scene = package.rtcore_scene.EmbreeScene()
    make(package.mesh_construction, scene)
    return scene


def rays(rng, count=5000):
    origins = rng.normal(size=(count, 3)).astype(np.float32)
    return origins, (rng.normal(size=(count, 3)) * 0.3 - origins).astype(np.float32)


def two_meshes(mesh, scene):
    mesh.TriangleMesh(scene, *TRIANGLE)
    mesh.TriangleMesh(scene, np.float32([[[0, 0, -1], [0, 1, -1], [1, 0, -1]], [[0, 0, -2], [1, 0, -2], [0, 1, -2]]]))


HEXAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]) - 0.5


def hexahedra(mesh, scene):
    mesh.ElementMesh(scene, HEXAHEDRON, np.arange(8).reshape(1, 8))


def tetrahedra(mesh, scene):
    mesh.ElementMesh(scene, HEXAHEDRON, np.array([[0, 1, 3, 4], [6, 5, 7, 2]]))


def test_queries():
    scene = build(ours, two_meshes)
    origins, direction = np.float32([[0.25, 0.25, 1], [5, 5, 1]]), np.float32([[0, 0, -2]])
    for query, expected, dtype in [
        ("INTERSECT", [0, -1], np.int32),
        ("OCCLUDED", [0, -1], np.int32),
        ("DISTANCE", [0.5, np.float32(1e37)], np.float32),
    ]:
        answer = scene.run(origins, direction, query=query)
        assert answer.tolist() == expected and answer.dtype == dtype
    reach = np.float32([0.25, 7])
    assert scene.run(origins, direction, dists=reach).tolist() == [-1, -1]
    assert reach.tolist() == [0.25, 7], "not overwritten"
    assert scene.run(origins, direction, dists=reach + 1, query="OCCLUDED").tolist() == [0, -1]
    answer = scene.run(origins, direction, dists=reach, query="DISTANCE")
    assert answer is reach and reach.tolist() == [0.25, 7]
    reach = np.float32([2, 7])
    hits = scene.run(origins, direction, dists=reach, output=True)
    assert reach.tolist() == [0.5, 7] == hits["tfar"].tolist()
    assert hits["primID"].tolist() == hits["geomID"].tolist() == [0, -1]
    assert hits["Ng"].tolist() == [[0, 0, 1], [0, 0, 0]]


def test_meshes_that_come_later():
    scene = build(ours, two_meshes)
    ray = np.float32([[0.25, 0.25, 3]]), np.float32([[0, 0, -1]])
    assert not scene.is_committed
    assert scene.run(*ray, query="DISTANCE").tolist() == [3]
    assert scene.is_committed
    late = ours.mesh_construction.TriangleMesh(scene, TRIANGLE[0] + np.float32([0, 0, 1]), TRIANGLE[1])
    assert scene.run(*ray, query="DISTANCE").tolist() == [2]
    assert late.geomID == 2


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_copies(duplicate):
    scene = build(ours, two_meshes)
    ray = np.float32([[0.25, 0.25, 3]]), np.float32([[0, 0, -1]])
    for _ in range(2):
        twin = duplicate(scene)
        late = ours.mesh_construction.TriangleMesh(twin, TRIANGLE[0] + np.float32([0, 0, 1]), TRIANGLE[1])
        assert late.geomID == 2
        assert twin.run(*ray, query="DISTANCE").tolist() == [2]
        assert scene.run(*ray, query="DISTANCE").tolist() == [3]


def test_indices_may_be_floats_as_in_embreex():
    ray = np.float32([[0.25, 0.25, 3]]), np.float32([[0, 0, -1]])
    scene = ours.rtcore_scene.EmbreeScene()
    ours.mesh_construction.TriangleMesh(scene, TRIANGLE[0], TRIANGLE[1].astype(np.float64))
    ours.mesh_construction.ElementMesh(scene, HEXAHEDRON, np.arange(8.0).reshape(1, 8))
    assert scene.run(*ray, query="DISTANCE").tolist() == [2.5]
    assert scene.run(*ray, output=True)["geomID"].tolist() == [1]


def test_distances_that_cannot_be_overwritten_are_told_before_the_work():
    scene = build(ours, two_meshes)
    ray = np.float32([[0.25, 0.25, 3]]), np.float32([[0, 0, -1]])
    reach = np.float32([7])
    reach.flags.writeable = False
    with pytest.raises(ValueError, match="dists"):
        scene.run(*ray, dists=reach, query="DISTANCE")
    with pytest.raises(ValueError, match="dists"):
        scene.run(*ray, dists=reach, output=True)
    assert not scene.is_committed
    assert scene.run(*ray, dists=reach).tolist() == [0], "only read"


@pytest.mark.parametrize("make", [two_meshes, hexahedra, tetrahedra])
def test_the_same_as_embreex(theirs, rng, make):
    a, b = build(ours, make), build(theirs, make)
    origins, directions = rays(rng)
    x, y = a.run(origins, directions, output=True), b.run(origins, directions, output=True)
    assert x.keys() == y.keys()
    same = (x["primID"] == y["primID"]) & (x["geomID"] == y["geomID"])
    assert same.mean() > 0.999
    assert (x["primID"] >= 0).mean() > 0.1
    for key in x:
        assert x[key].dtype == y[key].dtype and x[key].shape == y[key].shape, key
        assert np.allclose(x[key][same], y[key][same], rtol=1e-5, atol=1e-5), key
    for query in ("INTERSECT", "OCCLUDED", "DISTANCE"):
        x, y = a.run(origins, directions, 0.9, query), b.run(origins, directions, 0.9, query)
        assert x.dtype == y.dtype
        assert np.isclose(x, y, rtol=1e-5).mean() > 0.999


def run(program):
    """A Python of its own: what is in sys.modules matters."""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_trimesh_runs_on_it():
    pytest.importorskip("trimesh")
    answer = run(
        "from twincast.compat import embreex; embreex.install()\n"
        "import sys, trimesh, trimesh.ray.ray_pyembree as backend\n"
        "assert backend.rtcore_scene.EmbreeScene.__module__.startswith('twincast.'), backend.rtcore_scene\n"
        "assert trimesh.ray.has_embree\n"
        "mesh = trimesh.creation.icosphere(use_embree=True)\n"
        "assert type(mesh.ray) is backend.RayMeshIntersector\n"
        "print(mesh.contains([[0, 0, 0], [2, 0, 0]]).tolist())\n"
        "print(mesh.ray.intersects_location([[-5, 0.1, 0.2]], [[1, 0, 0]])[1].tolist())\n"
        "embreex.uninstall()\n"
        "assert sys.modules.get('embreex') is not embreex\n"
    )
    assert answer.split("\n")[:2] == ["[True, False]", "[0, 0]"]


def test_too_late_is_told():
    pytest.importorskip("trimesh")
    run(
        "import trimesh, trimesh.ray\n"
        "from twincast.compat import embreex\n"
        "try: embreex.install()\n"
        "except RuntimeError as error: assert 'before trimesh' in str(error)\n"
        "else: raise SystemExit('no error')\n"
    )
