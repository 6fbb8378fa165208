"""Nearest points and distances, against every triangle in f64, and against closed forms."""

import brute
import numpy as np
import pytest

import twincast


def places(dtype):
    near = [(1.0, 0.0), (2.0**-20, 0.0), (2.0**20, 0.0)]
    return near if dtype == np.float32 else [*near, (1.0, 1e7), (1e-30, 0.0), (1e12, 1e14)]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_nearest_points(rng, dtype):
    for scale, offset in places(dtype):
        vertices, faces = brute.soup(rng, 400, size=24)
        points = rng.uniform(-400, 400, (300, 3))
        # On corners, and on edges, where many triangles are as near.
        points[:50] = vertices[faces[:50, 0]]
        points[50:100] = (vertices[faces[50:100, 0]] + vertices[faces[50:100, 1]]) / 2
        vertices, points = ((it * scale + offset).astype(dtype) for it in (vertices, points))
        scene = twincast.RaycastingScene()
        scene.add_triangles(vertices, faces)
        whole = [(it.astype(np.float64) - offset) / scale for it in (vertices, points)]
        distances = brute.nearest(whole[0], faces, whole[1])
        least = distances.min(axis=1)
        # What subtraction rounds far from zero, in units of the scale; and the type of the answer.
        slack = 1e-12 + 1e-15 * offset / scale
        eps = 8 * np.finfo(dtype).eps
        distance = scene.compute_distance(points)
        assert distance.dtype == dtype
        assert np.allclose(distance / scale, least, rtol=eps, atol=slack * 400)
        nearest = scene.compute_closest_points(points)
        tri = nearest["primitive_ids"].astype(np.int64)
        rows = np.arange(len(points))
        assert np.allclose(distances[rows, tri], least, rtol=1e-12, atol=slack * 400)
        span = np.abs(vertices).max()
        found = nearest["points"].astype(np.float64)
        assert np.allclose(np.linalg.norm(found - points, axis=1) / scale, least, atol=(eps * span / scale) + slack)
        u, v = nearest["primitive_uvs"].astype(np.float64).T
        a, b, c = (vertices[faces[tri, k]].astype(np.float64) for k in range(3))
        weighed = a * (1 - u - v)[:, None] + b * u[:, None] + c * v[:, None]
        assert np.abs(weighed - found).max() <= 8 * eps * span
        assert (u >= 0).all() and (v >= 0).all() and (u + v <= 1 + eps).all()


@pytest.mark.parametrize("away", [1e3, 1e6, 1e9, 1e12, 1e15])
def test_the_nearest_point_is_on_the_mesh_however_far_the_point(away):
    """On a unit cube's face at x = 0.5, across from the point."""
    import trimesh

    scene = twincast.RaycastingScene()
    scene.add_triangles(trimesh.creation.box())
    found = scene.compute_closest_points([[away, 0.125, 0.25]])
    assert found["points"][0, 0] == 0.5 and np.abs(found["points"]).max() <= 0.5
    # Farther out, squares of distances no longer tell the face's points apart.
    if away <= 1e6:
        assert np.abs(found["points"] - [[0.5, 0.125, 0.25]]).max() < 1e-15 * away


def test_distances_that_are_large():
    """Squares of distances leave f64, and distances float32, before points do."""
    import warnings

    import trimesh

    scene = twincast.RaycastingScene()
    scene.add_triangles(trimesh.creation.box())
    points = np.array([[1e200, 0, 0], [3e300, -4e300, 0], [2, 0, 0]])
    assert np.allclose(scene.compute_distance(points), [1e200, 5e300, 1.5], rtol=1e-15)
    assert np.allclose(scene.compute_signed_distance(points), [1e200, 5e300, 1.5], rtol=1e-15)
    most = np.finfo(np.float32).max
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        single = np.float32([[-3.4e38, 3.4e38, 3.4e38], [3, 0, 0], [np.nan, 0, 0]])
        assert np.array_equal(scene.compute_distance(single), np.float32([most, 2.5, np.nan]), equal_nan=True)


def test_slivers_and_points(rng):
    """Triangles of which f32 cannot tell the normal, and some without an area."""
    a = rng.uniform(-1, 1, (400, 3))
    b = a + rng.uniform(-0.5, 0.5, (400, 3))
    c = a + (b - a) * rng.uniform(-1, 2, (400, 1)) + rng.normal(size=(400, 3)) * np.logspace(-12, -3, 400)[:, None]
    b[::10] = a[::10]
    c[::20] = a[::20]
    vertices = np.stack([a, b, c], axis=1).reshape(-1, 3).astype(np.float32)
    faces = np.arange(1200).reshape(-1, 3)
    points = rng.uniform(-1.5, 1.5, (500, 3)).astype(np.float32)
    for dtype in (np.float32, np.float64):
        scene = twincast.RaycastingScene()
        # The f64 scene lies where f32 has no room for it.
        shift = 0.0 if dtype == np.float32 else 1e5
        scene.add_triangles(vertices.astype(dtype) + dtype(shift), faces)
        distance = scene.compute_distance(points.astype(dtype) + dtype(shift))
        expected = brute.nearest(vertices.astype(np.float64), faces, points.astype(np.float64)).min(axis=1)
        assert np.allclose(distance, expected, rtol=1e-6, atol=1e-9)


def cube(dtype=np.float32):
    """The cube from -1 to 1, and its signed distance."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [corner for a, b, c, d in sides for corner in ((a, b, c), (a, c, d))]
    return corners, np.array(faces, np.uint32)


def cube_distance(points):
    q = np.abs(points) - 1
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("nsamples", [1, 5])
def test_signed_distance_of_a_cube(rng, dtype, nsamples):
    scene = twincast.RaycastingScene()
    scene.add_triangles(*cube(dtype))
    points = rng.uniform(-2, 2, (40, 50, 3)).astype(dtype)
    expected = cube_distance(points.astype(np.float64))
    signed = scene.compute_signed_distance(points, nsamples=nsamples)
    assert signed.shape == points.shape[:-1] and signed.dtype == dtype
    assert np.allclose(signed, expected, rtol=0, atol=4 * np.finfo(dtype).eps)
    assert np.array_equal(np.abs(signed), scene.compute_distance(points))
    occupancy = scene.compute_occupancy(points, nsamples=nsamples)
    assert occupancy.dtype == dtype and np.array_equal(occupancy, (expected < 0).astype(dtype))


def test_points_that_are_not_finite():
    scene = twincast.RaycastingScene()
    scene.add_triangles(*cube())
    points = np.float32([[np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 0]])
    assert np.isnan(scene.compute_distance(points)).tolist() == [True, True, False]
    nearest = scene.compute_closest_points(points)
    assert (nearest["primitive_ids"] == scene.INVALID_ID).tolist() == [True, True, False]
    assert scene.compute_occupancy(points).tolist() == [0, 0, 1]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_that_are_very_far_away(rng, dtype):
    """Squares of their distances are beyond f32."""
    vertices, faces = brute.soup(rng, 100)
    scene = twincast.RaycastingScene()
    scene.add_triangles(vertices.astype(dtype), faces)
    for away in (1e10, 1e18, 1e19, 1e20, 1e37) + ((1e40, 1e150) if dtype == np.float64 else ()):
        points = (rng.normal(size=(20, 3)) * away).astype(dtype)
        expected = np.linalg.norm(points.astype(np.float64), axis=1)
        assert np.allclose(scene.compute_distance(points), expected, rtol=1e-6 + 1e3 / away, atol=0)
        assert np.allclose(scene.compute_signed_distance(points), expected, rtol=1e-6 + 1e3 / away, atol=0)
        assert (scene.compute_closest_points(points)["primitive_ids"] < len(faces)).all()


def test_a_scene_without_triangles():
    scene = twincast.RaycastingScene()
    assert np.isnan(scene.compute_signed_distance(np.zeros((2, 3), np.float32))).all()
    assert scene.cast_rays(np.ones((2, 6), np.float32))["t_hit"].tolist() == [np.inf, np.inf]
