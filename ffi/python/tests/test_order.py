"""Many rays and points at once, of which the points are sorted within, against few at a time, which are not; and against closed forms."""

import numpy as np
import pytest
import trimesh

import twincast

#: More points than are left as they come.
SPHERE = trimesh.creation.icosphere(subdivisions=5)
MANY, FEW = 20_000, 500


def sphere_scene(dtype, shift=0.0):
    scene = twincast.RaycastingScene()
    scene.add_triangles(SPHERE.vertices.astype(dtype) + dtype(shift), SPHERE.faces)
    return scene


def at_once_and_apart(ask, *arrays):
    """Answers to all, and to few at a time."""
    parts = range(0, len(arrays[0]), FEW)
    return ask(*arrays), np.concatenate([ask(*(array[i : i + FEW] for array in arrays)) for i in parts])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_in_any_order(rng, dtype):
    shift = 0.0 if dtype == np.float32 else 1e6 / 3
    scene = sphere_scene(dtype, shift)
    origins = rng.normal(size=(MANY, 3)) * 3
    directions = rng.normal(size=(MANY, 3)) - 0.4 * origins
    origins[7], directions[11], directions[13] = np.nan, 0, (1, 0, 0)
    rays = np.hstack([origins + shift, directions]).astype(dtype)
    for name in ("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs", "primitive_normals"):
        together, apart = at_once_and_apart(lambda rays: scene.cast_rays(rays)[name], rays)
        assert np.array_equal(together, apart), name
    together, apart = at_once_and_apart(scene.test_occlusions, rays)
    assert np.array_equal(together, apart) and together.any() and not together.all()
    intersector = twincast.RayMeshIntersector(trimesh.Trimesh(SPHERE.vertices + shift, SPHERE.faces, process=False))
    together, apart = at_once_and_apart(intersector.intersects_first, rays[:, :3], rays[:, 3:])
    assert np.array_equal(together, apart)
    # The closed form, but for what the facets cut off.
    o, d = origins, directions / np.linalg.norm(directions, axis=1)[:, None].clip(1e-300)
    b = np.einsum("ij,ij->i", o, d)
    square = b * b - (np.einsum("ij,ij->i", o, o) - 1)
    sure = np.abs(square) > 0.01
    expected = (square > 0) & (-b + np.sqrt(square.clip(0)) > 0)
    assert np.array_equal((together >= 0)[sure], expected[sure])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lists_of_many_rays(rng, dtype):
    """Whatever many threads have listed stands where the counts say, begins with the first hit, and is what other questions answer."""
    shift = 0.0 if dtype == np.float32 else 1e6 / 3
    scene = sphere_scene(dtype, shift)
    origins = rng.normal(size=(MANY, 3)) * 3
    rays = np.hstack([origins + shift, rng.normal(size=(MANY, 3)) - 0.4 * origins]).astype(dtype)
    hits, counts = scene.list_intersections(rays), scene.count_intersections(rays)
    splits = hits["ray_splits"]
    assert np.array_equal(splits, np.concatenate([[0], np.cumsum(counts)])) and splits.dtype == np.uint32
    assert np.array_equal(hits["ray_ids"], np.repeat(np.arange(MANY), counts))
    assert set(counts.tolist()) == {0, 1, 2}
    assert (np.diff(hits["t_hit"])[np.diff(hits["ray_ids"].astype(int)) == 0] > 0).all()
    cast, hit = scene.cast_rays(rays), counts > 0
    assert np.array_equal(hit, np.isfinite(cast["t_hit"]))
    for name in ("t_hit", "geometry_ids", "primitive_ids", "primitive_uvs"):
        assert hits[name].dtype == cast[name].dtype, name
        assert np.array_equal(hits[name][splits[:-1][hit]], cast[name][hit]), name
    intersector = twincast.RayMeshIntersector(
        trimesh.Trimesh(SPHERE.vertices.astype(dtype) + dtype(shift), SPHERE.faces, process=False)
    )
    o, d = rays[:, :3], rays[:, 3:]
    tri, ray, locations = intersector.intersects_id(o, d, return_locations=True)
    assert np.array_equal(tri, hits["primitive_ids"]) and np.array_equal(ray, hits["ray_ids"])
    assert tri.dtype == ray.dtype == np.int64
    # On the sphere, but for what the facets cut off.
    assert np.abs(np.linalg.norm(locations - shift, axis=1) - 1).max() < 2e-3
    first = np.unique(ray, return_index=True)[1]
    some = intersector.intersects_id(o, d, max_hits=1, return_locations=True)
    assert all(np.array_equal(few, whole[first]) for few, whole in zip(some, (tri, ray, locations)))
    assert np.array_equal(intersector.intersects_first(o, d)[hit], tri[first])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lists_of_nothing(dtype):
    empty = twincast.RaycastingScene()
    for scene, count in [(sphere_scene(dtype), 0), (empty, 3)]:
        hits = scene.list_intersections(np.ones((count, 6), dtype))
        assert hits["ray_splits"].tolist() == [0] * (count + 1)
        shapes = {key: (value.shape, value.dtype) for key, value in hits.items() if key != "ray_splits"}
        ids = {key: ((0,), np.uint32) for key in ("ray_ids", "geometry_ids", "primitive_ids")}
        assert shapes == {**ids, "t_hit": ((0,), dtype), "primitive_uvs": ((0, 2), dtype)}


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_signs_of_many_points(rng, dtype):
    """Balls without a triangle lend their sign to what is in them."""
    shift = 0.0 if dtype == np.float32 else 1e6 / 3
    scene = sphere_scene(dtype, shift)
    points = rng.uniform(-1.5, 1.5, (MANY, 3))
    # Close to the facets, to both sides.
    points[: MANY // 4] *= (1 + rng.normal(size=(MANY // 4, 1)) * 1e-3) / np.linalg.norm(points[: MANY // 4], axis=1)[:, None]
    points = (points + shift).astype(dtype)
    together, apart = at_once_and_apart(scene.compute_signed_distance, points)
    assert np.array_equal(together, apart)
    # Occupancy counts crossings for each point.
    assert np.array_equal(together < 0, scene.compute_occupancy(points) == 1)
    radius = np.linalg.norm(points.astype(np.float64) - shift, axis=1)
    assert np.abs(together - (radius - 1)).max() < 2e-3


def test_signs_of_an_open_mesh_are_those_of_its_rays(rng):
    scene = twincast.RaycastingScene()
    scene.add_triangles(SPHERE.vertices.astype(np.float32), SPHERE.faces[: len(SPHERE.faces) // 2])
    points = rng.uniform(-1.5, 1.5, (MANY, 3)).astype(np.float32)
    signed = scene.compute_signed_distance(points)
    assert np.array_equal(signed < 0, scene.compute_occupancy(points) == 1)


def test_meshes_that_close_each_other(rng):
    """Halves that share no vertex, as two geometries, with a corner at a zero of the other sign."""
    vertices = SPHERE.vertices.astype(np.float32)
    other = np.where(vertices == 0, np.float32(-0.0), vertices)
    half = len(SPHERE.faces) // 2
    scene = twincast.RaycastingScene()
    scene.add_triangles(vertices, SPHERE.faces[:half])
    scene.add_triangles(other, SPHERE.faces[half:])
    points = rng.uniform(-1.5, 1.5, (MANY, 3)).astype(np.float32)
    signed = scene.compute_signed_distance(points)
    assert np.array_equal(signed, sphere_scene(np.float32).compute_signed_distance(points))
