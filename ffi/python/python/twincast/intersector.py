"""trimesh's ray interface."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from . import _arguments, _arrays, _native


class RayMeshIntersector:
    """Ray queries on one mesh, as ``trimesh.ray.ray_pyembree.RayMeshIntersector`` has them.

    ``mesh.ray = twincast.RayMeshIntersector(mesh)`` swaps it in for one mesh, and ``mesh.contains`` and whatever else of trimesh asks
    ``mesh.ray`` follows. The tree is built at the first query, and again once the mesh has changed.

    All of it is decided on the mesh's float64 vertices and float64 rays, for coordinates up to 1.8e18 and edges down to 1e-75 (somewhere
    below, f64 is too narrow for products of three lengths): ``scale_to_box`` is there for trimesh's sake and changes nothing.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        The mesh; anything with ``vertices`` (v, 3), ``faces`` (t, 3) and a ``__hash__`` that changes with them.
    scale_to_box : bool
        Ignored.
    threads : int
        For every query; 0 is one for each core.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True, *, threads: int = 0) -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._threads = _arguments.whole("threads", threads)
        self._cached: tuple[int, _native.Scene] | None = None

    @property
    def _scene(self) -> _native.Scene:
        key = hash(self.mesh)
        cached = self._cached
        if cached is None or cached[0] != key:
            vertices = _arrays.vectors("mesh.vertices", self.mesh.vertices)
            faces = _arrays.triangles("mesh.faces", self.mesh.faces, vertices)
            # Assigned at once, so that threads that ask at the same time build twice at worst.
            cached = self._cached = (key, _native.Scene([(vertices, faces)], self._threads))
        return cached[1]

    def intersects_location(
        self, ray_origins: Any, ray_directions: Any, multiple_hits: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where rays hit the surface.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) float
            Rays; directions of any length.
        multiple_hits : bool
            All hits of each ray, or the first.

        Returns
        -------
        locations : (m, 3) float64
            By ray, then by distance.
        index_ray : (m,) int64
        index_tri : (m,) int64
        """
        index_tri, index_ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: Any,
        ray_directions: Any,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[np.ndarray, ...]:
        """Which triangles rays hit.

        All hits come from one traversal. A ray through an edge or a corner that several triangles share crosses there once, so a
        closed mesh is hit an even number of times from outside. Of the border of an open mesh half counts, by a rule that makes meshes that
        continue each other be crossed once where they meet; a ray that hits it elsewhere hits nothing here. The first hit alone
        (``multiple_hits=False``) is what :meth:`intersects_first` tells, crossing or not. Of faces that the mesh holds twice, in the same
        winding, the first alone is hit.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) float
            Rays; directions of any length.
        multiple_hits : bool
            All hits of each ray, or the first.
        max_hits : int, optional
            The most hits of a ray, the nearest ones; all, if not given.
        return_locations : bool
            Whether the locations are wanted as well.

        Returns
        -------
        index_tri : (m,) int64
            By ray, then by distance.
        index_ray : (m,) int64
        locations : (m, 3) float64
            Only with ``return_locations``.
        """
        origins, directions = _rays(ray_origins, ray_directions)
        most = 2**63 - 1 if max_hits is None else _arguments.whole("max_hits", max_hits)
        if not multiple_hits and most > 0:
            return self._first(origins, directions, return_locations)
        ray, tri, locations = self._scene.crossings(
            origins,
            directions,
            most=most,
            locations=return_locations,
            threads=self._threads,
        )
        return (tri, ray, locations) if return_locations else (tri, ray)

    def _first(self, origins: np.ndarray, directions: np.ndarray, locations: bool) -> tuple[np.ndarray, ...]:
        if not locations:
            first = self._scene.first(origins, directions, threads=self._threads)
            ray = np.flatnonzero(first >= 0)
            return first[ray], ray
        t, _, tri, _ = self._scene.closest(origins, directions, threads=self._threads)
        ray = np.flatnonzero(tri >= 0)
        return tri[ray], ray, origins[ray] + directions[ray] * t[ray, None]

    def intersects_first(self, ray_origins: Any, ray_directions: Any) -> np.ndarray:
        """The triangle that each ray hits first: (n,) int64, -1 for none."""
        return self._scene.first(*_rays(ray_origins, ray_directions), threads=self._threads)

    def intersects_any(self, ray_origins: Any, ray_directions: Any) -> np.ndarray:
        """Whether each ray hits the surface: (n,) bool; True as well where it only touches an edge or a corner."""
        return self._scene.occluded(*_rays(ray_origins, ray_directions), threads=self._threads)

    def contains_points(self, points: Any) -> np.ndarray:
        """Whether each point is inside the mesh: (n,) bool.

        The parity of the crossings of a ray, which is exact for a closed mesh. Points before a hole of an open mesh count as outside if
        the opposite ray says so. On the surface itself it is either.

        Parameters
        ----------
        points : (n, 3) float
        """
        return self._scene.inside(_arrays.vectors("points", points), both_ways=True, threads=self._threads)

    def __getstate__(self) -> dict[str, Any]:
        # The tree is not pickled: it is built again at the first query.
        return {**self.__dict__, "_cached": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    def __copy__(self) -> RayMeshIntersector:
        # Of a class that is derived from this one with all that it has besides.
        twin = object.__new__(type(self))
        twin.__setstate__(self.__getstate__())
        return twin

    def __deepcopy__(self, memo: dict[int, Any]) -> RayMeshIntersector:
        # As trimesh's: the copy asks the same mesh.
        twin = memo[id(self)] = self.__copy__()
        for name in twin.__dict__.keys() - {"mesh"}:
            twin.__dict__[name] = copy.deepcopy(twin.__dict__[name], memo)
        return twin


def _rays(ray_origins: Any, ray_directions: Any) -> tuple[np.ndarray, np.ndarray]:
    origins = _arrays.vectors("ray_origins", ray_origins)
    directions = _arrays.vectors("ray_directions", ray_directions)
    if origins.shape != directions.shape:
        raise ValueError(
            f"Ray origin and direction don't match! ray_origins {origins.shape}, ray_directions {directions.shape}"
        )
    return origins, directions
