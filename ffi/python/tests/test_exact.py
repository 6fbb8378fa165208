"""Hits of soups of triangles, against every triangle in exact arithmetic: at any scale, and far from zero."""

import brute
import numpy as np
import pytest

import twincast

#: (power of two of a grid step, offset in grid steps): around zero, tiny, huge, and where f32 steps are 64 grid steps or more.
PLACES = [(0, 0), (-8, 0), (-100, 0), (40, 0), (0, 2**30), (-20, 2**33), (0, 2**36)]


class Case:
    def __init__(self, rng, place, triangles=300, count=600, dtype=np.float64):
        vertices, self.faces = brute.soup(rng, triangles)
        origins, self.whole_directions = brute.rays(rng, vertices, self.faces, count)
        # Doubled, for the middles of edges.
        self.hit, self.interior, self.t = brute.intersect(2 * vertices, self.faces, origins, self.whole_directions)
        step, offset = 2.0 ** place[0], place[1]
        self.vertices = (((2 * vertices) + offset) * step).astype(dtype)
        self.origins = ((origins + offset) * step).astype(dtype)
        self.directions = (self.whole_directions * step).astype(dtype)
        assert (self.vertices / step - offset == 2 * vertices).all(), "exact"

    @property
    def first(self):
        """The least t of each ray, infinite for none."""
        return np.where(self.hit, self.t, np.inf).min(axis=1)


@pytest.fixture(params=PLACES, ids=str)
def case(request, rng):
    return Case(rng, request.param)


@pytest.fixture(params=[np.float32, np.float64], ids=["f32", "f64"])
def near_case(request, rng):
    return Case(rng, (-8, 0), dtype=request.param)


def check_first(case, tri, t=None):
    first = case.first
    assert np.array_equal(tri >= 0, np.isfinite(first))
    rays = np.flatnonzero(tri >= 0)
    assert len(rays) > 50, "a test of hits"
    assert case.hit[rays, tri[rays]].all()
    named = case.t[rays, tri[rays]]
    # Which of two at the same t is named may depend on the last bit of t.
    assert np.allclose(named, first[rays], rtol=1e-14, atol=0)
    if t is not None:
        assert np.allclose(t[rays], first[rays], rtol=1e-12, atol=1e-300)


def mesh(case):
    class Mesh:
        vertices, faces = case.vertices, case.faces

    return twincast.RayMeshIntersector(Mesh())


def test_first_and_any(case):
    intersector = mesh(case)
    check_first(case, intersector.intersects_first(case.origins, case.directions))
    assert np.array_equal(intersector.intersects_any(case.origins, case.directions), case.hit.any(axis=1))


def test_first_hits_have_locations(case):
    tri, ray, location = mesh(case).intersects_id(
        case.origins, case.directions, multiple_hits=False, return_locations=True
    )
    first = np.full(len(case.origins), -1)
    first[ray] = tri
    check_first(case, first)
    expected = case.origins[ray] + case.directions[ray] * case.first[ray, None]
    assert np.allclose(location, expected, rtol=1e-15, atol=1e-12 * np.abs(case.directions).max())


def test_all_hits(case):
    tri, ray = mesh(case).intersects_id(case.origins, case.directions)
    assert (np.diff(ray) >= 0).all(), "by ray"
    t = case.t[ray, tri]
    same = np.diff(ray) == 0
    assert (np.diff(t)[same] >= -1e-12 * np.abs(t[1:][same])).all(), "by distance"
    assert case.hit[ray, tri].all()
    # All that are passed in the interior, once; of those that are touched some.
    named = np.zeros_like(case.hit)
    named[ray, tri] = True
    assert named.sum() == len(tri), "each once"
    assert (named >= case.interior).all()
    assert case.interior.sum() > 100


def test_f32_and_f64_scenes(near_case):
    case = near_case
    scene = twincast.RaycastingScene()
    scene.add_triangles(case.vertices, case.faces)
    rays = np.hstack([case.origins, case.directions])
    cast = scene.cast_rays(rays)
    assert cast["t_hit"].dtype == rays.dtype
    tri = cast["primitive_ids"].astype(np.int64)
    tri[cast["primitive_ids"] == scene.INVALID_ID] = -1
    check_first(case, tri)
    hits = tri >= 0
    eps = np.finfo(rays.dtype).eps
    assert np.allclose(cast["t_hit"][hits], case.first[hits], rtol=4 * eps, atol=0)
    assert np.isinf(cast["t_hit"][~hits]).all()
    # The point of the weights is the point of the ray.
    u, v = cast["primitive_uvs"][hits].astype(np.float64).T
    a, b, c = (case.vertices[case.faces[tri[hits], k]].astype(np.float64) for k in range(3))
    on_triangle = a * (1 - u - v)[:, None] + b * u[:, None] + c * v[:, None]
    on_ray = case.origins[hits] + case.directions[hits] * case.first[hits, None]
    assert np.abs(on_triangle - on_ray).max() < 8 * eps * np.abs(case.vertices).max()
    occluded = scene.test_occlusions(rays)
    assert np.array_equal(occluded, hits)


def test_ranges(near_case):
    case = near_case
    scene = twincast.RaycastingScene()
    scene.add_triangles(case.vertices, case.faces)
    rays = np.hstack([case.origins, case.directions])
    for near, far in [(0.25, 0.5), (0.0, 0.75), (0.5, np.inf)]:
        expected = (case.hit & (case.t >= near) & (case.t <= far)).any(axis=1)
        # At the very ends t in the type of the rays decides.
        eps = 1e-6
        sure = ~(case.hit & ((np.abs(case.t - near) < eps) & (near > 0) | (np.abs(case.t - far) < eps))).any(axis=1)
        assert sure.sum() > 300
        assert np.array_equal(scene.test_occlusions(rays, near, far)[sure], expected[sure])


def test_closed_meshes_are_crossed_evenly_through_edges_and_corners(rng):
    """A cube of 2 x 4 x 4 squares a side pair, rays through its corners and middles of edges, from outside and from inside."""
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=[2, 2, 2]).subdivide().subdivide()
    for shift in (0.0, 1e6, 2.0**40):
        class Mesh:
            vertices, faces = box.vertices + shift, box.faces

        intersector = twincast.RayMeshIntersector(Mesh())
        targets = np.vstack([box.vertices, box.triangles_center, (box.vertices[box.edges[:, 0]] + box.vertices[box.edges[:, 1]]) / 2])
        for start, parity in ((np.array([5.0, 3.0, 4.0]), 0), (np.array([0.25, 0.125, 0.5]), 1)):
            origins = np.broadcast_to(start + shift, targets.shape)
            directions = targets - start
            _, ray = intersector.intersects_id(origins, directions)
            counts = np.bincount(ray, minlength=len(targets))
            assert (counts % 2 == parity).all()


def test_origins_far_away(rng):
    """A mesh of size 1 that is aimed at from 1e9 away: the ray's own rounding decides, not f32's."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])

    class Mesh:
        faces = np.array([[0, 1, 2]])

    Mesh.vertices = vertices
    intersector = twincast.RayMeshIntersector(Mesh())
    for distance in (1e3, 1e9, 1e15, 1e30):
        x, y = rng.random((2, 500))
        origins = np.column_stack([x, y, np.full(500, distance)])
        directions = np.tile([0.0, 0.0, -1.0], (500, 1))
        assert np.array_equal(intersector.intersects_any(origins, directions), x + y <= 1)
        _, ray, location = intersector.intersects_id(origins, directions, return_locations=True)
        assert np.array_equal(location[:, :2], origins[ray, :2])
        away = intersector.intersects_any(origins, -directions)
        assert not away.any()


def one_triangle(corners):
    scene = twincast.RaycastingScene()
    scene.add_triangles(corners, [[0, 1, 2]])
    return scene


def verdicts(scene, rays):
    """What each kind of query says of rays at one triangle, all of them the same."""
    any_hit = scene.test_occlusions(rays).tolist()
    cast = scene.cast_rays(rays)
    assert np.isfinite(cast["t_hit"]).tolist() == any_hit and (cast["primitive_ids"] == 0).tolist() == any_hit
    assert np.isfinite(cast["primitive_uvs"]).all() and np.isfinite(cast["primitive_normals"]).all()
    assert scene.count_intersections(rays).tolist() == any_hit
    assert scene.list_intersections(rays)["ray_ids"].tolist() == np.flatnonzero(any_hit).tolist()
    assert (scene._scene.first(rays[:, :3], rays[:, 3:]) == 0).tolist() == any_hit
    return any_hit


@pytest.mark.parametrize("size", [1.0, 1e-20, 1e15])
def test_origins_up_to_the_farthest(rng, size):
    """Where a ray starts up to 1e80 away decides as exactly as from near."""
    hits = 0
    for power in (30, 45, 53, 54, 55, 58, 61, 64, 70, 75, 80):
        for _ in range(12):
            corners = rng.normal(size=(3, 3)) * size
            target = rng.dirichlet([1, 1, 1]) @ corners + rng.normal(size=3) * rng.choice([0, 0.3]) * size
            rays = np.zeros((8, 6))
            for i in range(3):
                # Along an axis, so that what is far takes no digits of what is near.
                rays[i, :3], rays[i, 3 + i] = target, 10.0 ** rng.integers(-3, 4) * rng.choice([-1, 1])
                rays[i, i] = -np.sign(rays[i, 3 + i]) * 10.0**power
            # Aslant, where the line goes through zero or far by it; and away.
            way = rng.integers(-9, 10, 3) * 2 + 1.0
            rays[3] = [*(-way * 2.0 ** int(power * 3.2)), *way]
            rays[4] = [*(-way * 2.0 ** int(power * 3.2) * [1, 1, 1 + 1e-15]), *way]
            rays[5] = [*(way * 2.0 ** int(power * 3.2)), *way]
            rays[6], rays[7] = rays[0] * [1, 1, 1, -1, -1, -1], rays[1] * [1, 1, 1, 1e140, 1e140, 1e140]
            rays[:3, 3:] *= rng.choice([1e-130, 1, 1e130])
            rays[7, 3:] = np.clip(rays[7, 3:], -1e140, 1e140)
            exact = [brute.exactly(corners, ray[:3], ray[3:]) for ray in rays]
            scene = one_triangle(corners)
            assert verdicts(scene, rays) == [hit is not None for hit in exact], (power, corners.tolist(), rays.tolist())
            for hit, t in zip(exact, scene.cast_rays(rays)["t_hit"]):
                assert hit is None or abs(t - float(hit[0])) <= 1e-11 * float(hit[0])
                hits += hit is not None
    assert hits > 150


@pytest.mark.parametrize("length", [1e-140, 1.0, 1e140])
def test_origins_beyond_the_farthest_miss(length):
    scene = one_triangle(np.float64([[0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    for away in (1e80, np.nextafter(1e80, np.inf), 1e81, 1e150, 1e308):
        rays = np.float64([[0.25, 0.25, away, 0, 0, -length], [0.25, 0.25, -away, 0, 0, length]])
        rays = np.vstack([rays, [[0.75, 0.75, away, 0, 0, -length], [0.25, 0.25, away, 0, 0, length]]])
        assert verdicts(scene, rays) == [away <= 1e80] * 2 + [False] * 2
    assert scene.compute_occupancy(np.full((1, 3), 1e90)).tolist() == [0]


def check_weights(uv):
    """None of the three is negative, without rounding: 1 less what is from a half on is exact."""
    assert (uv >= 0).all() and not np.signbit(uv).any()
    assert (uv.min(axis=-1) <= 1 - uv.max(axis=-1)).all(), uv[uv.min(axis=-1) > 1 - uv.max(axis=-1)]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("far", [0, 1, 2])
def test_weights_of_slivers(rng, dtype, far):
    """One corner is far away; the ray goes by the edge between the others, or anywhere near it."""
    hits = 0
    for power in [*range(2, 15)] * 12:
        corners = rng.normal(size=(3, 3))
        corners[far] *= 10.0**power
        corners = corners.astype(dtype)
        shares = rng.dirichlet([1, 1, 1])
        if rng.random() < 0.5:
            shares[(far + 1) % 3] = abs(rng.normal()) * 10.0 ** -rng.integers(1, 17)
        shares[far] *= 10.0**-power
        others = np.arange(3) != far
        shares[others] *= (1 - shares[far]) / shares[others].sum()
        way = rng.normal(size=3)
        origin = (shares @ corners.astype(np.float64) - way).astype(dtype)
        ray = np.concatenate([origin, (shares @ corners.astype(np.float64) - origin).astype(dtype)])[None]
        scene = one_triangle(corners)
        exact = brute.exactly(corners, ray[0, :3], ray[0, 3:])
        cast, listed = scene.cast_rays(ray), scene.list_intersections(ray)
        nearest = scene.compute_closest_points(ray[:, :3])["primitive_uvs"]
        assert nearest.dtype == dtype
        check_weights(nearest)
        check_weights(cast["primitive_uvs"])
        check_weights(listed["primitive_uvs"])
        assert np.isfinite(cast["t_hit"])[0] == (exact is not None)
        if exact is None:
            continue
        hits += 1
        if dtype == np.float64:
            for uv in (cast["primitive_uvs"], listed["primitive_uvs"]):
                assert np.abs(uv[0] - [float(exact[1]), float(exact[2])]).max() < 1e-9, (power, uv, exact)
    assert hits > 60


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_weights_of_all_hits(near_case, dtype):
    scene = twincast.RaycastingScene()
    scene.add_triangles(near_case.vertices / 3, near_case.faces)
    rays = np.hstack([near_case.origins / 3, near_case.directions / 7]).astype(dtype)
    check_weights(scene.cast_rays(rays)["primitive_uvs"])
    check_weights(scene.list_intersections(rays)["primitive_uvs"])
    # On corners and edges, too.
    points = np.concatenate([scene._meshes[0][0], rays[:, :3]]).astype(dtype)
    check_weights(scene.compute_closest_points(points)["primitive_uvs"])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_rays_that_are_not_finite_miss(bad):
    scene = twincast.RaycastingScene()
    scene.add_triangles(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    for dtype in (np.float32, np.float64):
        rays = np.tile(np.array([0.25, 0.25, 1, 0, 0, -1], dtype), (8, 1))
        rays[np.arange(6), np.arange(6)] = bad
        rays[6, 3:] = 0
        expected = [False] * 7 + [True]
        assert scene.test_occlusions(rays).tolist() == expected
        assert np.isfinite(scene.cast_rays(rays)["t_hit"]).tolist() == expected
        assert scene.count_intersections(rays).tolist() == [0] * 7 + [1]
        assert scene.list_intersections(rays)["ray_ids"].tolist() == [7]


def test_vertices_that_are_not_finite_are_not_hit():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [np.inf, 0, 0], [1e300, 0, 0], [0.1, 0.2, 0.3]])

    class Mesh:
        faces = np.array([[0, 1, 3], [0, 1, 4], [0, 1, 5], [0, 1, 2]])

    Mesh.vertices = vertices
    intersector = twincast.RayMeshIntersector(Mesh())
    first = intersector.intersects_first([[0.25, 0.25, 1]], [[0, 0, -1]])
    assert first.tolist() == [3]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_that_start_on_the_surface(rng, dtype):
    """At corners and middles of edges t is 0 in several triangles; a zero with a sign is not before one without."""
    case = Case(rng, (-8, 0), dtype=dtype)
    step = dtype(2.0**-8)
    corners = 2 * np.rint(case.vertices / step / 2).astype(np.int64)[case.faces]
    starts = np.concatenate([corners[:, 0], (corners[:, 1] + corners[:, 2]) // 2])
    directions = rng.integers(-64, 65, starts.shape) * 2 + 1
    hit, _, t = brute.intersect(np.rint(case.vertices / step).astype(np.int64), case.faces, starts, directions)
    lowest = np.where(hit & (t == 0), np.arange(len(case.faces)), len(case.faces)).min(axis=1)
    on = lowest < len(case.faces)
    assert on.sum() > 300
    rays = np.hstack([starts * step, directions * step]).astype(dtype)[on]
    scene = twincast.RaycastingScene()
    scene.add_triangles(case.vertices, case.faces)
    cast = scene.cast_rays(rays)
    assert (cast["t_hit"] == 0).all() and not np.signbit(cast["t_hit"]).any()
    assert np.array_equal(cast["primitive_ids"], lowest[on])
    assert not np.signbit(scene.list_intersections(rays)["t_hit"]).any()
    assert np.array_equal(mesh(case).intersects_first(rays[:, :3], rays[:, 3:]), lowest[on])


@pytest.mark.parametrize("length", [1.0, 1e-20, 1e-39, 1e-44])
def test_short_directions_in_f32(length):
    """Denormal ones, and those that f32 has no t for: all queries agree on what is hit."""
    scene = twincast.RaycastingScene()
    scene.add_triangles(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    for away in (1.0, 1e10, 1e19, 1e25):
        origins = np.float32([[0.25, 0.25, away], [0.25, 0.25, -away], [0.9, 0.9, away], [0.25, 0.25, away]])
        directions = np.float32([[0, 0, -length], [0, 0, length], [0, 0, -length], [0, 0, length]])
        rays, expected = np.hstack([origins, directions]), [True, True, False, False]
        cast = scene.cast_rays(rays)
        assert np.isfinite(cast["t_hit"]).tolist() == expected
        assert (cast["primitive_ids"] == 0).tolist() == expected
        t = away / directions[1, 2].astype(np.float64)
        assert np.allclose(cast["t_hit"][:2], min(t, np.finfo(np.float32).max), rtol=1e-6)
        assert scene.test_occlusions(rays).tolist() == expected
        assert scene.count_intersections(rays).tolist() == expected
        assert scene.list_intersections(rays)["ray_ids"].tolist() == [0, 1]
        assert np.array_equal(scene.list_intersections(rays)["t_hit"], cast["t_hit"][:2])

        class Mesh:
            vertices, faces = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])

        intersector = twincast.RayMeshIntersector(Mesh())
        assert intersector.intersects_any(origins, directions).tolist() == expected
        assert intersector.intersects_first(origins, directions).tolist() == [0, 0, -1, -1]
        assert intersector.intersects_id(origins, directions)[1].tolist() == [0, 1]


def test_threads_do_not_change_answers(rng):
    case = Case(rng, (-8, 0), triangles=2000, count=5000)
    rays = np.hstack([case.origins, case.directions])
    answers = []
    for threads in (1, 2, 7):
        scene = twincast.RaycastingScene(nthreads=threads)
        scene.add_triangles(case.vertices, case.faces)
        answers.append((scene.cast_rays(rays, threads), scene.list_intersections(rays, threads)))
    for cast, crossings in answers[1:]:
        for key, value in answers[0][0].items():
            assert np.array_equal(value, cast[key]), key
        for key, value in answers[0][1].items():
            assert np.array_equal(value, crossings[key]), key
