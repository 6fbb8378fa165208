"""Rates beside those of embreex, trimesh and Open3D, in turn, on the same rays: `make bench-python`.

Rays start around the mesh and lead to random points of its surface; points are random in its box. Of each several rounds are made, and
medians of the ratios told.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import trimesh

import twincast
from twincast._native import DEBUG_ASSERTIONS
from twincast.compat.embreex import mesh_construction as our_meshes
from twincast.compat.embreex import rtcore_scene as our_scene


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions and triangles; polygons as fans."""
    vertices, faces = [], []
    for line in path.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif word == "f":
            corners = [int(corner.split("/")[0]) - 1 for corner in rest]
            faces += [(corners[0], *pair) for pair in zip(corners[1:], corners[2:])]
    return np.array(vertices), np.array(faces)


class Contest:
    """What is asked of each package: (name, aim, number asked, ours, theirs)."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, count: int) -> None:
        rng = np.random.default_rng(1)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        around = rng.normal(size=(count, 3))
        around *= 0.75 * np.linalg.norm(high - low) / np.linalg.norm(around, axis=1)[:, None]
        self.origins = (low + high) / 2 + around
        corners = vertices[faces[rng.integers(0, len(faces), count)]]
        targets = np.einsum("nk,nkd->nd", rng.dirichlet((1, 1, 1), count), corners)
        self.directions = targets - self.origins
        self.points = rng.uniform(low, high, (count // 5, 3)).astype(np.float32)
        self.mesh = trimesh.Trimesh(vertices, faces, process=False)
        self.vertices, self.faces = vertices.astype(np.float32), faces.astype(np.uint32)

    def contests(self):
        o, d = self.origins, self.directions
        o32, d32 = o.astype(np.float32), d.astype(np.float32)
        rays = np.hstack([o32, d32])
        count, few = len(rays), len(rays) // 10
        intersector = twincast.RayMeshIntersector(self.mesh)
        scene = twincast.RaycastingScene()
        scene.add_triangles(self.vertices, self.faces)
        shim = our_scene.EmbreeScene()
        our_meshes.TriangleMesh(shim, self.vertices, self.faces)
        try:
            from embreex import mesh_construction, rtcore_scene
            from trimesh.ray.ray_pyembree import RayMeshIntersector
        except ImportError as error:
            print(f"embreex is not compared with: {error}")
        else:
            embree = rtcore_scene.EmbreeScene()
            mesh_construction.TriangleMesh(embree, self.vertices, self.faces.astype(np.int32))
            theirs = RayMeshIntersector(self.mesh)
            yield "first hit, over embreex", 6, count, lambda: shim.run(o32, d32), lambda: embree.run(o32, d32)
            yield "first hit of f64, over embreex", 6, count, lambda: intersector.intersects_first(o, d), lambda: embree.run(o32, d32)
            yield "first hit, over trimesh", None, few, lambda: intersector.intersects_first(o[:few], d[:few]), lambda: theirs.intersects_first(o[:few], d[:few])
            yield "all hits, over trimesh", 30, few, lambda: intersector.intersects_id(o[:few], d[:few]), lambda: theirs.intersects_id(o[:few], d[:few])
        try:
            import open3d
        except ImportError as error:
            print(f"Open3D is not compared with: {error}")
            return
        tensor = open3d.core.Tensor
        other = open3d.t.geometry.RaycastingScene()
        other.add_triangles(tensor(self.vertices), tensor(self.faces))
        their_rays, points = tensor(rays), self.points
        some = points[: len(points) // 10]
        yield "first hit, over Open3D", 2.5, count, lambda: scene.cast_rays(rays), lambda: other.cast_rays(their_rays)
        yield "any hit, over Open3D", None, count, lambda: scene.test_occlusions(rays), lambda: other.test_occlusions(their_rays)
        yield "count, over Open3D", 4, count, lambda: scene.count_intersections(rays), lambda: other.count_intersections(their_rays)
        yield "list, over Open3D", None, count, lambda: scene.list_intersections(rays), lambda: other.list_intersections(their_rays)
        ours = (lambda: scene.compute_signed_distance(points), len(points))
        yield "signed distance, over Open3D", 20, ours[1], ours[0], lambda: other.compute_signed_distance(tensor(some)), len(some)


def seconds(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", type=Path, nargs="?", help="an OBJ file; a sphere of 80,000 triangles without one")
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    if DEBUG_ASSERTIONS:
        parser.error("the package in this environment was built for tests (WHEEL_PROFILE=dev); `make test-python` puts a fast one there")
    if arguments.mesh:
        vertices, faces = read_obj(arguments.mesh)
    else:
        sphere = trimesh.creation.icosphere(subdivisions=6)
        vertices, faces = sphere.vertices, sphere.faces
    print(f"{len(faces)} triangles, {arguments.rays} rays, {twincast.ISA}")
    print(f"{'':34}{'ours M/s':>10}{'theirs':>10}{'ratio':>8}{'aim':>6}")
    for name, aim, count, ours, theirs, *rest in Contest(vertices, faces, arguments.rays).contests():
        their_count = rest[0] if rest else count
        ours(), theirs()
        rounds = [(count / seconds(ours), their_count / seconds(theirs)) for _ in range(arguments.rounds)]
        a, b = np.median(rounds, axis=0) / 1e6
        ratio = np.median([x / y for x, y in rounds])
        print(f"{name:34}{a:10.3f}{b:10.3f}{ratio:8.2f}{aim or '':>6}", flush=True)


if __name__ == "__main__":
    main()
