"""What is wrong with arguments is told with their names; what can be read where it lies is not copied."""

from fractions import Fraction

import numpy as np
import pytest

import twincast
from twincast import _arrays
from twincast.compat.embreex import mesh_construction, rtcore_scene

TRIANGLE = (np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.uint32([[0, 1, 2]]))


class Mesh:
    vertices, faces = TRIANGLE


class Short(Mesh):
    vertices = TRIANGLE[0][:2]


class Unwilling:
    """As a tensor of which gradients are wanted."""

    def __dlpack__(self, **_):
        raise ValueError("not so")

    def __array__(self, *_, **__):
        raise RuntimeError("call detach first")


class Bare:
    """As a mesh of Open3D that has nothing yet."""

    vertex = triangle = {}


pinhole = twincast.RaycastingScene.create_rays_pinhole


def scene():
    scene = twincast.RaycastingScene()
    scene.add_triangles(*TRIANGLE)
    return scene


def embree():
    scene = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(scene, *TRIANGLE)
    return scene


GOOD = np.zeros((2, 3))


@pytest.mark.parametrize(
    "error, words, call",
    [
        (ValueError, "ray_origins", lambda: twincast.RayMeshIntersector(Mesh()).intersects_first(np.zeros((2, 2)), GOOD)),
        (ValueError, "triangle_indices", lambda: scene().add_triangles(TRIANGLE[0], np.zeros((0, 4), int))),
        (ValueError, "triangle_indices", lambda: scene().add_triangles(TRIANGLE[0], [[]])),
        (ValueError, "triangle_indices", lambda: scene().add_triangles(TRIANGLE[0], np.zeros((5, 0), int))),
        (TypeError, "triangle_indices", lambda: scene().add_triangles(TRIANGLE[0], np.array([], dtype="U1"))),
        (ValueError, "up another", lambda: pinhole(60, [0, 0, 0], [0, 0, 5], [0, 0, 1e200], 2, 2)),
        (TypeError, "fov_deg", lambda: pinhole([60], [0, 0, 0], [0, 0, 1], [0, 1, 0], 2, 2)),
        (TypeError, "unit", lambda: twincast.render("x.glb", unit=None)),
        (TypeError, "up_axis", lambda: twincast.render("x.glb", up_axis=None)),
        (ValueError, "path, auto", lambda: twincast.render(Mesh(), integrator="nope")),
        (ValueError, "normals", lambda: twincast.render(Mesh(), normals="")),
        (ValueError, "ray_origins", lambda: twincast.RayMeshIntersector(Mesh()).intersects_first(np.zeros(3), np.zeros(3))),
        (ValueError, "don't match", lambda: twincast.RayMeshIntersector(Mesh()).intersects_id(GOOD, np.ones((3, 3)))),
        (ValueError, "don't match", lambda: twincast.RayMeshIntersector(Mesh()).intersects_any(GOOD, np.ones((1, 3)))),
        (TypeError, "ray_directions", lambda: twincast.RayMeshIntersector(Mesh()).intersects_any(GOOD, np.array([["a"] * 3] * 2))),
        (TypeError, "ray_origins", lambda: twincast.RayMeshIntersector(Mesh()).intersects_any(GOOD.astype(complex), GOOD)),
        (ValueError, "points", lambda: twincast.RayMeshIntersector(Mesh()).contains_points(np.zeros((2, 4)))),
        (ValueError, "max_hits", lambda: twincast.RayMeshIntersector(Mesh()).intersects_id(GOOD, GOOD, max_hits=-1)),
        (ValueError, "rays", lambda: scene().cast_rays(np.zeros((2, 5), np.float32))),
        (TypeError, "rays", lambda: scene().cast_rays([[None] * 6])),
        (ValueError, "nthreads", lambda: scene().cast_rays(np.zeros((2, 6)), nthreads=-1)),
        (ValueError, "query_points", lambda: scene().compute_distance(np.zeros((2, 6)))),
        (ValueError, "nsamples", lambda: scene().compute_occupancy(GOOD, nsamples=2)),
        (ValueError, "triangle_indices", lambda: twincast.RaycastingScene().add_triangles(TRIANGLE[0], [[0, 1, 3]])),
        (ValueError, "triangle_indices", lambda: twincast.RaycastingScene().add_triangles(TRIANGLE[0], [[0, 1, -1]])),
        (TypeError, "triangle_indices", lambda: twincast.RaycastingScene().add_triangles(TRIANGLE[0], [[0.0, 1, 2]])),
        (ValueError, "vertex_positions", lambda: twincast.RaycastingScene().add_triangles(np.zeros((3, 2)), [[0, 1, 2]])),
        (TypeError, "vertex_positions", lambda: twincast.RaycastingScene().add_triangles(np.zeros((3, 3)))),
        (ValueError, "device", lambda: twincast.RaycastingScene(device="CUDA:0")),
        (ValueError, "fov_deg", lambda: twincast.RaycastingScene.create_rays_pinhole(0, [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, 4)),
        (ValueError, "up", lambda: twincast.RaycastingScene.create_rays_pinhole(60, [0, 0, 0], [0, 0, 1], [0, 0, 1], 4, 4)),
        (ValueError, "intrinsic_matrix", lambda: twincast.RaycastingScene.create_rays_pinhole(np.eye(4), np.eye(4), 4, 4)),
        (ValueError, "vec_directions", lambda: embree().run(np.zeros((4, 3)), np.zeros((2, 3)))),
        (ValueError, "vec_origins", lambda: embree().run(np.zeros((4, 2)), np.zeros((4, 3)))),
        (ValueError, "dists", lambda: embree().run(np.zeros((4, 3)), np.zeros((4, 3)), dists=np.zeros(3, np.float32))),
        (ValueError, "NEAREST", lambda: embree().run(GOOD, GOOD, query="NEAREST")),
        (ValueError, "vertices", lambda: mesh_construction.TriangleMesh(rtcore_scene.EmbreeScene(), TRIANGLE[0])),
        (ValueError, "indices", lambda: mesh_construction.TriangleMesh(rtcore_scene.EmbreeScene(), TRIANGLE[0], [[0, 1, 7]])),
        (ValueError, "indices", lambda: mesh_construction.ElementMesh(rtcore_scene.EmbreeScene(), TRIANGLE[0], [[0, 1, 2]])),
        (TypeError, "scene", lambda: mesh_construction.TriangleMesh(None, *TRIANGLE)),
        (TypeError, "scene", lambda: twincast.render(7)),
        (ValueError, "size", lambda: twincast.render(TRIANGLE, size=(0, 4))),
        (ValueError, "integrator", lambda: twincast.render(TRIANGLE, size=(4, 4), integrator="magic")),
        (ValueError, "camera", lambda: twincast.render(TRIANGLE, size=(4, 4), camera="none")),
        (ValueError, "eye", lambda: twincast.render(TRIANGLE, size=(4, 4), look_at=(0, 0, 0))),
        (ValueError, "eye and look_at are one point", lambda: twincast.render(TRIANGLE, size=(4, 4), eye=(0, 0, 0), look_at=(0, 0, 0))),
        (ValueError, "camera", lambda: twincast.render(TRIANGLE, size=(4, 4), eye=(0, 0, 1), look_at=(0, 0, 0), camera="front")),
        (ValueError, "threads", lambda: twincast.RayMeshIntersector(Mesh(), threads=-1)),
        (TypeError, "threads", lambda: twincast.RayMeshIntersector(Mesh(), threads="2")),
        (ValueError, "max_hits", lambda: twincast.RayMeshIntersector(Mesh()).intersects_id(GOOD, GOOD, max_hits=2**64)),
        (TypeError, "max_hits", lambda: twincast.RayMeshIntersector(Mesh()).intersects_id(GOOD, GOOD, max_hits=2.5)),
        (TypeError, "max_hits", lambda: twincast.RayMeshIntersector(Mesh()).intersects_id(GOOD, GOOD, max_hits="a")),
        (ValueError, "mesh.faces", lambda: twincast.RayMeshIntersector(Short()).intersects_any(GOOD, GOOD)),
        (TypeError, "nthreads", lambda: scene().cast_rays(np.zeros((2, 6)), nthreads="2")),
        (TypeError, "nthreads", lambda: scene().cast_rays(np.zeros((2, 6)), nthreads=1.5)),
        (ValueError, "nthreads", lambda: scene().cast_rays(np.zeros((2, 6)), nthreads=2**64)),
        (TypeError, "nthreads", lambda: twincast.RaycastingScene(nthreads="2")),
        (ValueError, "tnear", lambda: scene().test_occlusions(np.zeros((2, 6)), tnear=np.nan)),
        (ValueError, "tfar", lambda: scene().test_occlusions(np.zeros((2, 6)), tfar=np.nan)),
        (TypeError, "tnear", lambda: scene().test_occlusions(np.zeros((2, 6)), tnear="0.5")),
        (TypeError, "tnear", lambda: scene().test_occlusions(np.zeros((2, 6)), tnear=None)),
        (TypeError, "tfar", lambda: scene().test_occlusions(np.zeros((2, 6)), tfar=[0.5, 1])),
        (TypeError, "tfar", lambda: scene().test_occlusions(np.zeros((2, 6)), tfar=1j)),
        (TypeError, "nsamples", lambda: scene().compute_occupancy(GOOD, nsamples=None)),
        (TypeError, "nsamples", lambda: scene().compute_occupancy(GOOD, nsamples=2.5)),
        (TypeError, "mesh", lambda: scene().add_triangles()),
        (TypeError, "mesh", lambda: scene().add_triangles(mesh=TRIANGLE[0])),
        (TypeError, "mesh", lambda: scene().add_triangles(*TRIANGLE, mesh=Mesh())),
        (ValueError, "intrinsic_matrix", lambda: pinhole(np.diag([1.0, 0, 1]), np.eye(4), 4, 4)),
        (ValueError, "intrinsic_matrix", lambda: pinhole(np.diag([1.0, np.nan, 1]), np.eye(4), 4, 4)),
        (ValueError, "extrinsic_matrix", lambda: pinhole(np.eye(3), np.full((4, 4), np.inf), 4, 4)),
        (ValueError, "center", lambda: pinhole(60, [np.nan, 0, 0], [0, 0, 1], [0, 1, 0], 4, 4)),
        (ValueError, "fov_deg", lambda: pinhole(np.nan, [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, 4)),
        (TypeError, "fov_deg", lambda: pinhole("60", [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, 4)),
        (TypeError, "width_px", lambda: pinhole(60, [0, 0, 0], [0, 0, 1], [0, 1, 0])),
        (TypeError, "width_px", lambda: pinhole(np.eye(3), np.eye(4))),
        (TypeError, "width_px", lambda: pinhole(intrinsic_matrix=np.eye(3), extrinsic_matrix=np.eye(4))),
        (TypeError, "height_px", lambda: pinhole(60, [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, 4.5)),
        (TypeError, "height_px", lambda: pinhole(60, [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, "4")),
        (TypeError, "height_px", lambda: pinhole(60, [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, None)),
        (ValueError, "height_px", lambda: pinhole(60, [0, 0, 0], [0, 0, 1], [0, 1, 0], 4, 0)),
        (ValueError, "height_px", lambda: pinhole(np.eye(3), np.eye(4), 4, 0)),
        (TypeError, "indices", lambda: mesh_construction.TriangleMesh(rtcore_scene.EmbreeScene(), TRIANGLE[0], [[0, 1, 1.5]])),
        (TypeError, "indices", lambda: mesh_construction.TriangleMesh(rtcore_scene.EmbreeScene(), TRIANGLE[0], [[0, 1, np.nan]])),
        (ValueError, "spp", lambda: twincast.render(TRIANGLE, spp=-1)),
        (TypeError, "spp", lambda: twincast.render(TRIANGLE, spp=1.5)),
        (ValueError, "seed", lambda: twincast.render(TRIANGLE, seed=-1)),
        (ValueError, "threads", lambda: twincast.render(TRIANGLE, threads=-1)),
        (ValueError, "max_depth", lambda: twincast.render(TRIANGLE, max_depth=-1)),
        (ValueError, "max_depth", lambda: twincast.render(TRIANGLE, max_depth=1001)),
        (ValueError, "size", lambda: twincast.render(TRIANGLE, size=(2**32, 1))),
        (TypeError, "size", lambda: twincast.render(TRIANGLE, size=5)),
        (ValueError, "size", lambda: twincast.render(TRIANGLE, size=(1, 2, 3))),
        (TypeError, "size", lambda: twincast.render(TRIANGLE, size=("a", 3))),
        (TypeError, "size", lambda: twincast.render(TRIANGLE, size=(2.9, 3))),
        (TypeError, "fov", lambda: twincast.render(TRIANGLE, eye=(0, 0, 5), fov="a")),
        (ValueError, "eye must be given with up and fov", lambda: twincast.render(TRIANGLE, up=(0, 0, 1), fov=50)),
        (ValueError, "nsamples", lambda: scene().compute_occupancy(GOOD, nsamples=10_001)),
        (ValueError, "extrinsic_matrix", lambda: pinhole(np.eye(3), np.zeros((4, 4)), 4, 4)),
        (ValueError, "float32", lambda: pinhole(60, [0, 0, 0], [0, 0, 1e40], [0, 1, 0], 4, 4)),
        (ValueError, "fov", lambda: twincast.render(TRIANGLE, eye=(0, 0, 5), fov=180)),
        (ValueError, "eye", lambda: twincast.render(TRIANGLE, eye=(0, 0, np.nan))),
        (ValueError, "background", lambda: twincast.render(TRIANGLE, background=(0, np.nan, 0))),
        (ValueError, "up_axis", lambda: twincast.render(TRIANGLE, up_axis="z")),
        (ValueError, "unit", lambda: twincast.render(TRIANGLE, unit="mm")),
        (ValueError, "scene", lambda: twincast.render({})),
        (ValueError, "scene", lambda: twincast.render([])),
        (ValueError, "faces", lambda: twincast.render((TRIANGLE[0][:2], TRIANGLE[1]))),
        (FileNotFoundError, "no-such", lambda: twincast.render("no-such.glb")),
        (TypeError, "integrator", lambda: twincast.render(TRIANGLE, integrator=3)),
        (TypeError, "camera", lambda: twincast.render(TRIANGLE, camera=3)),
        (TypeError, "normals", lambda: twincast.render(TRIANGLE, normals=3)),
        (TypeError, "unit", lambda: twincast.render(TRIANGLE, unit=3)),
        (ValueError, r"background must have the shape \(3,\)", lambda: twincast.render(TRIANGLE, background=(0, 0))),
        (ValueError, r"\(n, 3\)", lambda: twincast.RayMeshIntersector(Mesh()).intersects_any(np.zeros((2, 2)), GOOD)),
        (TypeError, "create_rays_pinhole", lambda: pinhole(fov=60)),
        (TypeError, "rays", lambda: scene().cast_rays(Unwilling())),
        (TypeError, "rays must hold real numbers, not str", lambda: scene().cast_rays(np.array([["0", 0, 1, 0, 0, -1]], object))),
        (TypeError, "triangle_indices must hold integers, not float", lambda: scene().add_triangles(TRIANGLE[0], np.array([[0, 1, 2.0]], object))),
        (ValueError, "rays", lambda: scene().cast_rays([[10**400, 0, 1, 0, 0, -1]])),
        (ValueError, "mesh must have vertex positions", lambda: scene().add_triangles(mesh=Bare())),
        (TypeError, "mesh must be a mesh of Open3D or trimesh; it is a ndarray", lambda: scene().add_triangles(mesh=TRIANGLE[0])),
    ],
)
def test_errors_name_the_argument(error, words, call):
    with pytest.raises(error, match=words):
        call()


def test_nothing_is_copied_that_need_not_be():
    for dtype in (np.float32, np.float64):
        rays = np.zeros((4, 6), dtype)
        for part in (rays[:, :3], rays[::2, 3:], np.asfortranarray(rays[:, :3])):
            assert np.shares_memory(_arrays.vectors("x", part), part)
    indices = np.zeros((4, 3), np.uint32)
    assert np.shares_memory(_arrays.indices("x", indices), indices)


def test_arrays_of_all_kinds():
    ray = [[0.25, 0.25, 1, 0, 0, -1]]
    for rays in (
        ray,
        np.array(ray, dtype=">f8"),
        np.array(ray, dtype=np.float16),
        np.array(np.array(ray) * 4, dtype=np.int8) / 4,
        np.asfortranarray(np.float32(ray)),
        np.repeat(np.float64(ray), 2, axis=0)[::2],
        np.frombuffer(b"x" + np.float64(ray).tobytes(), np.float64, offset=1).reshape(1, 6),
        np.array(ray, dtype=object),
        [[Fraction(1, 4), 0.25, 1, 0, np.int8(0), -1]],
    ):
        assert scene().cast_rays(rays)["primitive_ids"].tolist() == [0]


@pytest.mark.parametrize("dtype", ["<f4", ">f4", "<f8", ">f8"])
def test_either_byte_order_has_the_same_answers(dtype):
    rays = np.array([[0.25, 0.25, 1, 0, 0, -1], [2, 2, 1, 0, 0, -1]], dtype)
    native = rays.astype(rays.dtype.newbyteorder("="))
    assert _arrays.floats("x", rays).dtype == native.dtype and _arrays.floats("x", rays).dtype.isnative
    one = twincast.RaycastingScene()
    one.add_triangles(TRIANGLE[0].astype(dtype), TRIANGLE[1].astype(">u4"))
    for key, answer in one.cast_rays(rays).items():
        expected = one.cast_rays(native)[key]
        assert answer.dtype == expected.dtype and np.array_equal(answer, expected), key
    assert one.compute_distance(rays[:, :3]).dtype == native.dtype
    reach = np.array([0.5, 8], dtype)
    distances = embree().run(rays[:, :3], rays[:, 3:], dists=reach, query="DISTANCE")
    assert distances.tolist() == [0.5, 8]
    # Where it is of their type, it is overwritten.
    reach[:] = 8
    embree().run(rays[:, :3], rays[:, 3:], dists=reach, query="DISTANCE")
    assert reach.tolist() == ([1, 8] if native.dtype == np.float32 else [8, 8])


def test_dlpack():
    class Foreign:
        """Only what the protocol demands."""

        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **arguments):
            return self.array.__dlpack__(**arguments)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    scene = twincast.RaycastingScene()
    scene.add_triangles(Foreign(TRIANGLE[0]), Foreign(TRIANGLE[1]))
    rays = Foreign(np.float32([[0.25, 0.25, 1, 0, 0, -1]]))
    assert scene.cast_rays(rays)["t_hit"].numpy().tolist() == [1.0]
