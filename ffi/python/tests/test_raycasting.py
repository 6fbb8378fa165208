"""Open3D's contract; and Open3D itself, where it is installed."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from test_points import cube

import twincast


@pytest.fixture
def scene():
    scene = twincast.RaycastingScene()
    assert scene.add_triangles(*cube()) == 0
    far = cube()
    assert scene.add_triangles(far[0] + np.float32([5, 0, 0]), far[1]) == 1
    return scene


def test_shapes_and_types(scene):
    rays = np.zeros((2, 4, 6), np.float32)
    rays[..., 0], rays[..., 1], rays[..., 3] = -3, [-2, -0.5, 0.25, 2], 2
    cast = scene.cast_rays(rays)
    assert {key: (value.shape, value.dtype.name) for key, value in cast.items()} == {
        "t_hit": ((2, 4), "float32"),
        "geometry_ids": ((2, 4), "uint32"),
        "primitive_ids": ((2, 4), "uint32"),
        "primitive_uvs": ((2, 4, 2), "float32"),
        "primitive_normals": ((2, 4, 3), "float32"),
    }
    assert cast["t_hit"].numpy()[0].tolist() == [np.inf, 1, 1, np.inf]
    assert type(cast["t_hit"].numpy()) is np.ndarray
    assert cast["geometry_ids"][1].tolist() == [scene.INVALID_ID, 0, 0, scene.INVALID_ID]
    assert cast["primitive_normals"][0].tolist() == [[0, 0, 0], [-1, 0, 0], [-1, 0, 0], [0, 0, 0]]
    assert scene.count_intersections(rays).tolist() == [[0, 4, 4, 0]] * 2
    assert scene.count_intersections(rays).dtype == np.int32
    assert scene.test_occlusions(rays).tolist() == [[False, True, True, False]] * 2
    assert scene.test_occlusions(rays, tfar=0.5).tolist() == [[False] * 4] * 2
    assert scene.test_occlusions(rays, tnear=5).tolist() == [[False] * 4] * 2
    one = scene.cast_rays(rays[0, 1])
    assert one["t_hit"].shape == () and one["t_hit"].item() == 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_range_that_begins_behind_the_origin_begins_there(scene, dtype):
    rays = np.array([[-3, 0.5, 0.25, 1, 0, 0], [9, 0.5, 0.25, 1, 0, 0], [0, 0.5, 0.25, 1, 0, 0]], dtype)
    for near in (-1, -1e-300, -1e40, -np.inf, np.float32(-2)):
        assert scene.test_occlusions(rays, tnear=near).tolist() == [True, False, True]
        assert scene.test_occlusions(rays, tnear=near, tfar=1.5).tolist() == [False, False, True]
    assert not scene.test_occlusions(rays, tnear=-3, tfar=-1).any()


def test_results_answer_as_tensors_do(scene):
    rays = np.float32([[-3, 2, 0, 1, 0, 0], [-3, 0.5, 0.25, 1, 0, 0]])
    hits = scene.cast_rays(rays)
    finite = hits["t_hit"].isfinite()
    assert finite.tolist() == [False, True] and finite.numpy().dtype == bool
    assert hits["t_hit"].cpu() is hits["t_hit"]
    assert hits["geometry_ids"].isfinite().tolist() == [True, True]
    one = scene.cast_rays(rays[1])["t_hit"]
    assert one.numpy().shape == () and one.item() == 2 and one.isfinite().numpy().tolist() is True
    # What is picked out is NumPy's: it can be hashed, and does not change with the array.
    assert isinstance(hits["t_hit"][1], np.float32) and hits["t_hit"][1].item() == 2
    # So is what all of it is brought down to.
    assert isinstance(hits["t_hit"].min(), np.float32) and hash(hits["t_hit"].min()) == hash(2.0)
    assert isinstance(finite.any(), np.bool_) and isinstance(hits["geometry_ids"].sum(), np.integer)
    assert (hits["t_hit"] + 1).numpy().tolist() == [np.inf, 3] and (one + 1).numpy().shape == ()


def test_no_memory_is_an_error():
    """Of answers for each ray or point, and of normals, in a process that may have little."""
    if not os.path.exists("/proc/self/statm"):
        pytest.skip("nobody says how much memory there is")
    program = (
        "import resource, numpy as np, twincast\n"
        "scene = twincast.RaycastingScene()\n"
        "scene.add_triangles(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])\n"
        "rays = np.broadcast_to(np.float32([0.25, 0.25, 1, 0, 0, -1]), (2**31, 6))\n"
        "origins, directions = rays[:, :3], rays[:, 3:]\n"
        "scene.cast_rays(rays[:5000])\n"
        "scene.compute_closest_points(rays[:5000, :3])\n"
        "none = np.broadcast_to(np.uint32(0), 2**31)\n"
        "size = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size + 2**30,) * 2)\n"
        "for ask in (scene._scene.first, scene._scene.occluded, scene._scene.cast, scene._scene.closest, scene._scene.count):\n"
        "    try: ask(origins, directions)\n"
        "    except MemoryError: continue\n"
        "    raise SystemExit(f'{ask} found room')\n"
        "of_points = [(ask, (origins,)) for ask in (scene._scene.nearest, scene._scene.distance, scene._scene.inside)]\n"
        "for ask, arrays in [(scene._scene.normals, (none, none)), *of_points]:\n"
        "    try: ask(*arrays)\n"
        "    except MemoryError: continue\n"
        "    raise SystemExit(f'{ask} found room')\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_normals_of_what_is_there_and_what_is_not(scene):
    scene.cast_rays(np.zeros((1, 6), np.float32))
    geometry = np.uint32([0, 1, 0, 2, scene.INVALID_ID, 1] * 500)
    primitive = np.uint32([0, 11, 12, 0, 0, scene.INVALID_ID] * 500)
    normals = scene._scene.normals(geometry, primitive)
    corners, faces = cube()
    a, b, c = (corners[faces[[0, 11], k]].astype(np.float64) for k in range(3))
    expected = np.zeros((6, 3))
    expected[:2] = np.cross(b - a, c - a)
    expected[:2] /= np.linalg.norm(expected[:2], axis=1)[:, None]
    assert normals.dtype == np.float64 and np.array_equal(normals, np.tile(expected, (500, 1)))
    assert np.array_equal(scene._scene.normals(geometry[::2], primitive[::2], threads=1), normals[::2])
    assert scene._scene.normals(geometry[:0], primitive[:0]).shape == (0, 3)
    with pytest.raises(ValueError, match="primitive"):
        scene._scene.normals(geometry, primitive[1:])


def test_a_mesh_may_be_named():
    class Mesh:
        vertices, faces = cube()

    class Legacy:
        """As Open3D's older meshes are."""

        vertices, triangles = map(np.ndarray.tolist, cube())

    scene = twincast.RaycastingScene()
    assert scene.add_triangles(Legacy()) == 0 and scene.count_intersections(np.float32([-3, 0.5, 0.25, 1, 0, 0])) == 2
    scene = twincast.RaycastingScene()
    assert scene.add_triangles(mesh=Mesh()) == 0
    assert scene.add_triangles(vertex_positions=Mesh.vertices, triangle_indices=Mesh.faces) == 1
    assert scene.count_intersections(np.float32([-3, 0.5, 0.25, 1, 0, 0])) == 4


def test_lists(scene):
    rays = np.float32([[-3, 2, 0, 1, 0, 0], [-3, 0.5, 0.25, 1, 0, 0], [2, 0.5, 0.25, -2, 0, 0]])
    crossings = scene.list_intersections(rays)
    assert crossings["ray_splits"].tolist() == [0, 0, 4, 6]
    assert crossings["ray_ids"].tolist() == [1] * 4 + [2] * 2
    assert crossings["t_hit"].tolist() == [2, 4, 7, 9, 0.5, 1.5]
    assert crossings["geometry_ids"].tolist() == [0, 0, 1, 1, 0, 0]
    assert {key: value.dtype.name for key, value in crossings.items()} == {
        "ray_splits": "uint32",
        "ray_ids": "uint32",
        "t_hit": "float32",
        "geometry_ids": "uint32",
        "primitive_ids": "uint32",
        "primitive_uvs": "float32",
    }


def test_meshes_that_come_later(scene):
    ray = np.float32([[0, 9, 0, 0, -1, 0]])
    assert scene.cast_rays(ray)["t_hit"].tolist() == [8]
    corners, faces = cube()
    assert scene.add_triangles(corners + np.float32([0, 3, 0]), faces) == 2
    assert scene.cast_rays(ray)["t_hit"].tolist() == [5]
    assert scene.cast_rays(ray)["geometry_ids"].tolist() == [2]


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_copies(scene, duplicate):
    """Before a query and after it; and what is added to one is not in the other."""
    ray = np.float32([[0, 9, 0, 0, -1, 0]])
    corners, faces = cube()
    for _ in range(2):
        twin = duplicate(scene)
        assert isinstance(twin, twincast.RaycastingScene)
        assert twin.add_triangles(corners + np.float32([0, 3, 0]), faces) == 2
        assert twin.cast_rays(ray)["geometry_ids"].tolist() == [2]
        assert scene.cast_rays(ray)["t_hit"].tolist() == [8]
        assert duplicate(scene).cast_rays(ray)["t_hit"].tolist() == [8]


def test_deep_copies_of_a_subclass_have_its_attributes_for_themselves(scene):
    class Named(twincast.RaycastingScene):
        pass

    named = Named()
    named.add_triangles(*cube())
    named.notes, named.itself, named.name = {"of": [1]}, named, "cube"
    shallow, deep = copy.copy(named), copy.deepcopy(named)
    assert type(shallow) is type(deep) is Named and deep.name == "cube"
    named.notes["of"].append(2)
    assert shallow.notes is named.notes and deep.notes == {"of": [1]} and deep.itself is deep
    assert deep._meshes[0] is named._meshes[0], "nobody changes them"
    both = copy.deepcopy([named, named])
    assert both[0] is both[1] and both[0] is not named


def test_arrays_of_the_caller_stay_the_callers(scene):
    corners, faces = cube()
    other = twincast.RaycastingScene()
    other.add_triangles(corners, faces)
    corners[:] = 0
    assert other.cast_rays(np.float32([[-3, 0.5, 0.25, 1, 0, 0]]))["t_hit"].tolist() == [2]


def test_a_pinholes_directions_may_have_any_length():
    make = twincast.RaycastingScene.create_rays_pinhole
    rays = make(90, [0, 0, 0], [0, 0, 4], [0, 1, 0], 4, 2)
    for up in (1e200, 1e-170):
        np.testing.assert_allclose(make(90, [0, 0, 0], [0, 0, 4], [0, up, 0], 4, 2), rays, atol=1e-6)
    np.testing.assert_allclose(make(90, [0, 0, -1e200], [0, 0, 4], [0, 1, 0], 4, 2), rays, atol=1e-6)
    near = make(90, [0, 0, 0], [0, 0, 4e-110], [0, 1e90, 0], 4, 2)
    np.testing.assert_allclose(near[..., 3:], rays[..., 3:], atol=1e-6)


def test_rays_of_a_pinhole():
    rays = twincast.RaycastingScene.create_rays_pinhole(90, [0, 0, 0], [0, 0, 4], [0, 1, 0], 4, 2)
    assert rays.shape == (2, 4, 6) and rays.dtype == np.float32
    assert np.allclose(rays[..., :3], [0, 0, 4])
    # Open3D's pictures are turned by half a turn: the first pixel is at the lower right.
    assert np.allclose(rays[0, 0, 3:], [0.75, -0.25, -1])
    assert np.allclose(rays[1, 3, 3:], [-0.75, 0.25, -1])


@pytest.fixture
def open3d():
    try:
        import open3d
    except ImportError as error:
        pytest.skip(f"Open3D is not there to compare with: {error}")
    return open3d


class Both:
    """A bumpy sphere, in both packages."""

    def __init__(self, open3d, rng):
        sphere = open3d.geometry.TriangleMesh.create_sphere(resolution=40)
        vertices = np.asarray(sphere.vertices) * (1 + 0.2 * rng.random((len(sphere.vertices), 1)))
        self.vertices, self.faces = vertices.astype(np.float32), np.asarray(sphere.triangles).astype(np.uint32)
        tensor = open3d.core.Tensor
        self.ours, self.theirs = twincast.RaycastingScene(), open3d.t.geometry.RaycastingScene()
        # DLPack on the way.
        self.ours.add_triangles(tensor(self.vertices), tensor(self.faces))
        self.theirs.add_triangles(tensor(self.vertices), tensor(self.faces))
        origins = rng.normal(size=(20000, 3)) * 1.5
        self.rays = np.hstack([origins, rng.normal(size=(20000, 3)) * 0.5 - origins]).astype(np.float32)


def test_the_same_as_open3d(open3d, rng):
    both = Both(open3d, rng)
    rays = open3d.core.Tensor(both.rays)
    ours, theirs = both.ours.cast_rays(rays), both.theirs.cast_rays(rays)
    assert ours.keys() == theirs.keys()
    # Embree's own verdicts are not exact at edges.
    same = ours["primitive_ids"] == theirs["primitive_ids"].numpy()
    assert same.mean() > 0.999
    for key, value in theirs.items():
        value = value.numpy()
        assert ours[key].dtype == value.dtype and ours[key].shape == value.shape, key
        assert np.allclose(ours[key][same], value[same], rtol=1e-4, atol=1e-4), key
    assert (both.ours.test_occlusions(rays) == both.theirs.test_occlusions(rays).numpy()).mean() > 0.999
    assert (both.ours.count_intersections(rays) == both.theirs.count_intersections(rays).numpy()).mean() > 0.999
    ours, theirs = both.ours.list_intersections(rays), both.theirs.list_intersections(rays)
    assert ours.keys() == theirs.keys()
    for key, value in theirs.items():
        assert ours[key].dtype == value.numpy().dtype, key
        assert abs(len(ours[key]) - len(value.numpy())) <= len(value.numpy()) * 1e-3


def test_the_same_distances_as_open3d(open3d, rng):
    both = Both(open3d, rng)
    points = open3d.core.Tensor(both.rays[:5000, :3].copy())
    ours, theirs = both.ours.compute_closest_points(points), both.theirs.compute_closest_points(points)
    assert ours.keys() == theirs.keys()
    # An f32 step of the distance moves a point by its root, where two sides of an edge are as near.
    apart = np.linalg.norm(ours["points"] - theirs["points"].numpy(), axis=1)
    assert (apart < 1e-5).mean() > 0.99 and apart.max() < 1e-2
    ours_distance, theirs_distance = (
        np.linalg.norm(both.rays[:5000, :3] - np.asarray(it["points"].numpy(), np.float64), axis=1) for it in (ours, theirs)
    )
    assert np.allclose(ours_distance, theirs_distance, atol=2e-6)
    for name in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        a, b = getattr(both.ours, name)(points), getattr(both.theirs, name)(points).numpy()
        assert a.dtype == b.dtype and a.shape == b.shape
        assert np.isclose(a, b, atol=1e-4).mean() > 0.999, name


def test_the_same_pinhole_as_open3d(open3d):
    make = (twincast.RaycastingScene.create_rays_pinhole, open3d.t.geometry.RaycastingScene.create_rays_pinhole)
    look = dict(fov_deg=50, center=[1, 2, 3], eye=[4, -5, 6], up=[0.1, 0.2, 1], width_px=8, height_px=6)
    ours, theirs = make[0](**look), make[1](**look).numpy()
    assert np.allclose(ours, theirs, atol=1e-4)
    intrinsic = np.array([[10, 0.5, 4], [0, 11, 3], [0, 0, 1.0]])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = turn, [1, 2, 3]
    ours, theirs = make[0](intrinsic, extrinsic, 8, 6), make[1](intrinsic, extrinsic, 8, 6).numpy()
    assert np.allclose(ours, theirs, atol=1e-4)
