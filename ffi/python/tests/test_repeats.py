"""Faces that a mesh holds twice are crossed once, as in NumPy's count of those that differ."""

import brute
import numpy as np
import pytest
from test_points import cube, cube_distance

import twincast


def distinct(vertices, faces):
    """The first of all faces with the same corners in the same winding: their numbers."""
    corners = (vertices[faces] + 0.0).tolist()
    keys = [min(c[k:] + c[:k] for k in range(3)) for c in corners]
    first = {}
    for number, key in enumerate(map(str, keys)):
        first.setdefault(key, number)
    return np.array(sorted(first.values()))


def repeated(rng, vertices, faces, share):
    """Some faces once more, turned by 0 to 2 corners, at vertices of their own, with zeros of either sign; and some of them flipped."""
    again = faces[rng.random(len(faces)) < share]
    turns = rng.integers(0, 3, len(again))
    again = again[np.arange(len(again))[:, None], (np.arange(3) + turns[:, None]) % 3]
    flipped = faces[rng.random(len(faces)) < share / 4, ::-1]
    twins = vertices.copy()
    twins[(twins == 0) & (rng.random(twins.shape) < 0.5)] = -0.0
    both = np.concatenate([vertices, twins])
    faces = np.concatenate([faces, again + rng.integers(0, 2, (len(again), 1)) * len(vertices), flipped, again[:5]])
    return both, faces[rng.permutation(len(faces))]


@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("dtype, shift", [(np.float32, 0.0), (np.float64, 0.0), (np.float64, 2.0**30)])
def test_soups_are_crossed_as_without_repeats(rng, share, dtype, shift):
    whole, faces = brute.soup(rng, 200)
    # A quarter lie in planes through zero.
    whole[: len(whole) // 4, 2] = 0
    origins, directions = brute.rays(rng, whole, faces, 500)
    vertices, faces = repeated(rng, 2.0 * whole, faces, share)
    first = distinct(vertices, faces)
    assert (len(first) < len(faces) - 5) == (share > 0)
    hit, interior, t = brute.intersect(vertices, faces[first], origins, directions)
    vertices, origins = (vertices + shift).astype(dtype), (origins + shift).astype(dtype)
    directions = directions.astype(dtype)

    class Mesh:
        pass

    Mesh.vertices, Mesh.faces = vertices, faces
    intersector, scene = twincast.RayMeshIntersector(Mesh()), twincast.RaycastingScene()
    scene.add_triangles(vertices, faces)
    rays = np.hstack([origins, directions])
    tri, ray, location = intersector.intersects_id(origins, directions, return_locations=True)
    named = intersector.intersects_id(origins, directions)
    assert np.array_equal(named[0], tri) and np.array_equal(named[1], ray)
    counts = np.bincount(ray, minlength=len(rays))
    assert np.array_equal(scene.count_intersections(rays), counts)
    listed = scene.list_intersections(rays)
    assert np.array_equal(listed["ray_ids"], ray) and np.array_equal(listed["primitive_ids"], tri)
    # Of those that differ: all that are passed in the interior, once; of those that are touched some.
    place = np.full(len(faces), -1)
    place[first] = np.arange(len(first))
    assert (place[tri] >= 0).all(), "the first of those that are the same"
    crossed = np.zeros_like(hit)
    crossed[ray, place[tri]] = True
    assert crossed.sum() == len(tri) and (crossed <= hit).all() and (crossed >= interior).all()
    assert interior.sum() > 100
    # Those alone, in a mesh of their own, are crossed the same way.
    Mesh.faces = faces[first]
    alone = twincast.RayMeshIntersector(Mesh()).intersects_id(origins, directions, return_locations=True)
    assert np.array_equal(first[alone[0]], tri) and np.array_equal(alone[1], ray)
    assert np.allclose(alone[2], location, rtol=1e-12, atol=1e-6)
    # What is hit first is the lowest.
    nearest = np.where(hit, t, np.inf).min(axis=1)
    found = intersector.intersects_first(origins, directions)
    assert np.array_equal(found >= 0, np.isfinite(nearest))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("share", [0.1, 1.0])
@pytest.mark.parametrize("nsamples", [1, 3])
def test_the_inside_of_a_closed_mesh_stays_inside(rng, dtype, share, nsamples):
    corners, faces = cube(dtype)
    again = faces[: max(1, round(share * len(faces)))]
    faces = np.concatenate([faces, np.roll(again, 1, axis=1)])
    points = rng.uniform(-1.5, 1.5, (5000, 3)).astype(dtype)
    expected = cube_distance(points.astype(np.float64))
    scene = twincast.RaycastingScene()
    scene.add_triangles(corners, faces)
    assert np.array_equal(scene.compute_occupancy(points, nsamples=nsamples) == 1, expected < 0)
    signed = scene.compute_signed_distance(points, nsamples=nsamples)
    assert np.allclose(signed, expected, rtol=0, atol=4 * np.finfo(dtype).eps)

    class Mesh:
        vertices = corners

    Mesh.faces = faces
    assert np.array_equal(twincast.RayMeshIntersector(Mesh()).contains_points(points), expected < 0)


def test_two_bodies_that_touch_face_to_face_keep_both_faces():
    corners, faces = cube(np.float64)
    far = corners + [2, 0, 0]

    class Mesh:
        vertices = np.concatenate([corners, far])

    Mesh.faces = np.concatenate([faces, faces + len(corners)])
    intersector = twincast.RayMeshIntersector(Mesh())
    assert len(intersector.intersects_id([[-5, 0.3, 0.2]], [[1, 0, 0]])[0]) == 4
    assert intersector.contains_points([[0, 0.3, 0.2], [2, 0.3, 0.2], [4, 0.3, 0.2]]).tolist() == [True, True, False]


def test_other_meshes_count_for_themselves_also_when_they_come_later():
    corners, faces = cube()
    ray = np.float32([-5, 0.3, 0.2, 1, 0, 0])
    scene = twincast.RaycastingScene()
    scene.add_triangles(corners, faces)
    assert scene.count_intersections(ray) == 2
    assert scene.add_triangles(corners + np.float32([4, 0, 0]), np.concatenate([faces, faces])) == 1
    assert scene.count_intersections(ray) == 4
    assert scene.list_intersections(ray)["geometry_ids"].tolist() == [0, 0, 1, 1]
    # The first once more, as a mesh of its own: there are two of it.
    scene.add_triangles(corners, faces)
    assert scene.count_intersections(ray) == 6
    assert scene.cast_rays(ray)["geometry_ids"] == 0


def test_triangles_that_are_never_hit_may_be_repeated():
    corners = np.float64([[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [1e30, 0, 0]])

    class Mesh:
        vertices = corners
        faces = np.array([[0, 1, 3], [0, 1, 3], [0, 1, 4], [0, 1, 4], [0, 0, 1], [0, 0, 1], [0, 1, 2], [1, 2, 0]])

    tri, ray = twincast.RayMeshIntersector(Mesh()).intersects_id([[0.25, 0.25, 1]], [[0, 0, -1]])
    assert tri.tolist() == [6] and ray.tolist() == [0]
