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
