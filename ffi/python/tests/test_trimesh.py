"""trimesh's contract, and trimesh's own ray engine in NumPy as the other side."""

import copy
import pickle

import numpy as np
import pytest

import twincast

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def sphere():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    mesh.ray = twincast.RayMeshIntersector(mesh)
    return mesh


def random_rays(rng, count=300):
    origins = rng.normal(size=(count, 3))
    return origins, rng.normal(size=(count, 3))


def test_shapes_and_types(sphere, rng):
    origins, directions = random_rays(rng)
    tri, ray, location = sphere.ray.intersects_id(origins, directions, return_locations=True)
    assert tri.dtype == ray.dtype == np.int64 and location.dtype == np.float64
    assert tri.shape == ray.shape == location.shape[:1] and location.shape[1:] == (3,)
    assert len(sphere.ray.intersects_id(origins, directions)) == 2
    location2, ray2, tri2 = sphere.ray.intersects_location(origins, directions)
    assert np.array_equal(location, location2) and np.array_equal(ray, ray2) and np.array_equal(tri, tri2)
    first = sphere.ray.intersects_first(origins, directions)
    assert first.shape == (len(origins),) and first.dtype == np.int64
    hit = sphere.ray.intersects_any(origins, directions)
    assert hit.dtype == bool and np.array_equal(hit, first >= 0)
    assert np.array_equal(hit, np.bincount(ray, minlength=len(origins)) > 0)
    assert sphere.ray.contains_points(origins).dtype == bool
    assert sphere.ray.mesh is sphere


def test_nothing_is_hit(sphere):
    miss = ([[5.0, 5.0, 5.0]], [[0.0, 0.0, 1.0]])
    location, ray, tri = sphere.ray.intersects_location(*miss)
    assert location.shape == (0, 3) and ray.shape == tri.shape == (0,)
    assert sphere.ray.intersects_first(*miss).tolist() == [-1]
    for none in (np.zeros((0, 3)), []):
        location, ray, tri = sphere.ray.intersects_location(none, none)
        assert location.shape == (0, 3) and ray.shape == tri.shape == (0,)
        assert sphere.ray.intersects_any(none, none).shape == (0,)
        assert sphere.ray.contains_points(none).shape == (0,)


def test_a_mesh_without_triangles():
    class Empty:
        vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)

    intersector = twincast.RayMeshIntersector(Empty())
    rays = (np.zeros((2, 3)), np.ones((2, 3)))
    assert intersector.intersects_first(*rays).tolist() == [-1, -1]
    assert intersector.intersects_location(*rays)[0].shape == (0, 3)
    assert not intersector.contains_points(np.zeros((2, 3))).any()


def test_the_same_as_trimesh(sphere, rng):
    pytest.importorskip("rtree")
    origins, directions = random_rays(rng)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    theirs = trimesh.ray.ray_triangle.RayMeshIntersector(sphere)
    assert np.array_equal(theirs.intersects_first(origins, directions), sphere.ray.intersects_first(origins, directions))
    location, ray, tri = theirs.intersects_location(origins, directions)
    ours_location, ours_ray, ours_tri = sphere.ray.intersects_location(origins, directions)
    order, ours_order = np.lexsort((tri, ray)), np.lexsort((ours_tri, ours_ray))
    assert np.array_equal(ray[order], ours_ray[ours_order]) and np.array_equal(tri[order], ours_tri[ours_order])
    assert np.allclose(location[order], ours_location[ours_order], atol=1e-12)


def test_hits_are_cut_at_the_nearest(sphere):
    ray = ([[-5.0, 0.1, 0.2]], [[1.0, 0.0, 0.0]])
    all_tri, _ = sphere.ray.intersects_id(*ray)
    assert len(all_tri) == 2
    one_tri, one_ray = sphere.ray.intersects_id(*ray, max_hits=1)
    assert one_tri.tolist() == all_tri[:1].tolist() and one_ray.tolist() == [0]
    assert sphere.ray.intersects_first(*ray).tolist() == all_tri[:1].tolist()
    assert sphere.ray.intersects_id(*ray, multiple_hits=False)[0].tolist() == all_tri[:1].tolist()
    assert [len(part) for part in sphere.ray.intersects_id(*ray, multiple_hits=False, max_hits=1)] == [1, 1]
    for many in (True, False):
        nothing = sphere.ray.intersects_id(*ray, multiple_hits=many, max_hits=0, return_locations=True)
        assert [part.shape for part in nothing] == [(0,), (0,), (0, 3)]
        assert [part.dtype for part in nothing] == [np.int64, np.int64, np.float64]


def test_the_border_of_an_open_mesh():
    """It is touched from everywhere, but crossed as if a ray lay a little aside: half of it, by rule."""

    class Mesh:
        vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        faces = np.array([[0, 1, 2], [0, 2, 3]])

    intersector = twincast.RayMeshIntersector(Mesh())
    middles = np.array([[0.5, 0, 1], [1, 0.5, 1], [0.5, 1, 1], [0, 0.5, 1]])
    down = np.broadcast_to([0.0, 0, -1], middles.shape)
    assert intersector.intersects_any(middles, down).all()
    assert len(intersector.intersects_id(middles, down, multiple_hits=False)[0]) == 4
    _, ray = intersector.intersects_id(middles, down)
    assert len(ray) == 2
    # Two that together are closed again are crossed once.
    beyond = Mesh()
    beyond.vertices = Mesh.vertices + [1.0, 0, 0]
    _, next_to = twincast.RayMeshIntersector(beyond).intersects_id(middles[1:2], down[1:2])
    assert (1 in ray) + len(next_to) == 1


def test_points_inside(rng):
    """The closed form of a cube; and of one with a cavity."""
    outer, inner = trimesh.creation.box(extents=[2, 2, 2]), trimesh.creation.box(extents=[1, 1, 1])
    inner.invert()
    mesh = trimesh.util.concatenate([outer, inner])
    points = rng.uniform(-1.5, 1.5, (20000, 3))
    far = np.abs(points).max(axis=1)
    expected = (far < 1) & (far > 0.5)
    assert np.array_equal(twincast.RayMeshIntersector(mesh).contains_points(points), expected)
    # Where f32 has steps of a quarter of the cube.
    mesh.apply_translation([4e6] * 3)
    assert np.array_equal(twincast.RayMeshIntersector(mesh).contains_points(points + 4e6), expected)


def test_points_before_a_hole_are_outside():
    mesh = trimesh.creation.box(extents=[2, 2, 2])
    up = mesh.face_normals[:, 2] > 0.5
    mesh.update_faces(~up)
    intersector = twincast.RayMeshIntersector(mesh)
    assert not intersector.contains_points([[0, 0, 3.0], [0.2, 0.1, -1.5]]).any()


def test_the_tree_follows_the_mesh(sphere):
    ray = ([[-5.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]])
    assert sphere.ray.intersects_any(*ray).all()
    before = sphere.ray._scene
    assert sphere.ray._scene is before, "kept"
    sphere.apply_translation([0, 0, 10])
    assert not sphere.ray.intersects_any(*ray).any()
    sphere.vertices[:, 2] -= 10
    assert sphere.ray.intersects_any(*ray).all()


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_copies(sphere, rng, duplicate):
    rays = random_rays(rng)
    expected = sphere.ray.intersects_first(*rays)
    twin = duplicate(sphere.ray)
    assert isinstance(twin, twincast.RayMeshIntersector)
    assert np.array_equal(twin.intersects_first(*rays), expected)


def test_what_trimesh_asks_of_its_ray_engine(sphere):
    assert sphere.contains([[0, 0, 0], [0, 0, 2]]).tolist() == [True, False]
    reach = trimesh.proximity.longest_ray(sphere, [[0, 0, 0.5]], [[0, 0, 1.0]])
    assert np.isclose(reach, 0.5, atol=0.01).all()


def test_threads_share_one_intersector(sphere, rng):
    from concurrent.futures import ThreadPoolExecutor

    rays = random_rays(rng, 2000)
    expected = sphere.ray.intersects_first(*rays)
    fresh = twincast.RayMeshIntersector(sphere)
    with ThreadPoolExecutor(8) as pool:
        for answer in pool.map(lambda _: fresh.intersects_first(*rays), range(32)):
            assert np.array_equal(answer, expected)


def test_a_process_that_was_forked(sphere, rng):
    import multiprocessing

    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    rays = random_rays(rng)
    expected = sphere.ray.intersects_first(*rays)
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=lambda: queue.put(sphere.ray.intersects_first(*rays)))
    child.start()
    answer = queue.get(timeout=60)
    child.join()
    assert np.array_equal(answer, expected)


def test_copies_are_of_the_same_class():
    class Own(twincast.RayMeshIntersector):
        def __init__(self, mesh, extra):
            super().__init__(mesh)
            self.extra = extra

    class Mesh:
        vertices = np.float64([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
        faces = np.int64([[0, 1, 2]])

    own = Own(Mesh(), [7])
    assert copy.copy(own).extra is own.extra and copy.deepcopy(own).extra is not own.extra
    for twin in (copy.copy(own), copy.deepcopy(own)):
        assert type(twin) is Own and twin.extra == [7] and twin.mesh is own.mesh
        assert twin.intersects_first([[0.25, 0.25, 1]], [[0, 0, -1]]).tolist() == [0]
