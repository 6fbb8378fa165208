"""Open3D's ray interface, on NumPy and DLPack arrays."""

from __future__ import annotations

import math
from typing import Any, overload

import numpy as np

from . import _arguments, _arrays
from ._meshes import Meshes


class Result(np.ndarray):
    """A NumPy array that answers :meth:`numpy`, :meth:`cpu` and :meth:`isfinite`, as Open3D's tensors do.

    A single number that is picked out of it is NumPy's scalar, which answers ``item()``.
    """

    def __array_wrap__(self, array: np.ndarray, context: Any = None, return_scalar: bool = False) -> Any:
        # So is what all of it is brought down to, a sum or the largest, for which there is no context.
        return array[()] if array.ndim == 0 and context is None else array.view(Result)

    def numpy(self) -> np.ndarray:
        """The array itself, not copied."""
        return self.view(np.ndarray)

    def cpu(self) -> Result:
        """Itself: it is on the CPU."""
        return self

    def isfinite(self) -> Result:
        """Whether each number is neither infinite nor NaN: bool, of the same shape."""
        return np.asarray(np.isfinite(self)).view(Result)


def _result(array: np.ndarray, *shape: int) -> Result:
    return array.reshape(shape).view(Result)


class RaycastingScene(Meshes):
    """Triangle meshes that rays and points are held against, as ``open3d.t.geometry.RaycastingScene`` has them.

    Arrays may be NumPy's, or anything that answers ``__dlpack__`` and is on the CPU (Open3D's and PyTorch's tensors). Numbers
    come back in the type of the rays or points: float32 for float32, float64 for float64. Whether a ray hits is decided for the
    vertices and rays as they were given.

    Parameters
    ----------
    nthreads : int
        Threads to build the scene on; 0 is one for each core. So of every query, which takes ``nthreads`` of its own.
    device
        Ignored but for its type: the scene is on the CPU.
    """

    #: The id of no triangle and of no mesh.
    INVALID_ID = 0xFFFF_FFFF

    def __init__(self, nthreads: int = 0, device: Any = None) -> None:
        super().__init__(nthreads)
        if device is not None and "CPU" not in str(device).upper():
            raise ValueError(f"device must be the CPU, not {device}")

    def add_triangles(self, vertex_positions: Any = None, triangle_indices: Any = None, *, mesh: Any = None) -> int:
        """Adds a mesh; also after queries.

        Parameters
        ----------
        vertex_positions : (n, 3) float
            Or a mesh, without ``triangle_indices``.
        triangle_indices : (m, 3) int
        mesh : open3d.t.geometry.TriangleMesh, or anything with ``vertices`` and ``faces``
            Instead of both.

        Returns
        -------
        int
            The mesh's id: they are numbered from 0.
        """
        if mesh is not None:
            if vertex_positions is not None or triangle_indices is not None:
                raise TypeError("mesh must be given instead of vertex_positions and triangle_indices, not with them")
            vertex_positions, triangle_indices = _mesh("mesh", mesh)
        elif triangle_indices is None:
            vertex_positions, triangle_indices = _mesh("vertex_positions", vertex_positions)
        vertices = _arrays.vectors("vertex_positions", vertex_positions)
        return self._add(vertices, _arrays.triangles("triangle_indices", triangle_indices, vertices))

    def cast_rays(self, rays: Any, nthreads: int = 0) -> dict[str, Result]:
        """The first hit of each ray.

        Parameters
        ----------
        rays : (..., 6) float
            Origin and direction; the direction's length is the unit of ``t_hit``.

        Returns
        -------
        dict
            t_hit (...): infinite for a miss; what float32 cannot hold is its largest number. geometry_ids, primitive_ids (...) uint32:
            :attr:`INVALID_ID` for a miss. primitive_uvs (..., 2): the weights of a triangle's second and third corner. primitive_normals (..., 3): of unit length, by the
            right-hand rule.
        """
        origins, directions, shape = _rays(rays)
        nthreads = _threads(nthreads)
        if origins.dtype == np.float32:
            t, uv, primitive, geometry, normal = self._scene.cast(origins, directions, threads=nthreads)
        else:
            t, uv, primitive, geometry = self._scene.closest(origins, directions, threads=nthreads)
            # -1 becomes INVALID_ID.
            primitive, geometry = primitive.astype(np.uint32), geometry.astype(np.uint32)
            normal = self._scene.normals(geometry, primitive, threads=nthreads)
        return {
            "t_hit": _result(t, *shape),
            "geometry_ids": _result(geometry, *shape),
            "primitive_ids": _result(primitive, *shape),
            "primitive_uvs": _result(uv, *shape, 2),
            "primitive_normals": _result(normal, *shape, 3),
        }

    def test_occlusions(self, rays: Any, tnear: float = 0.0, tfar: float = math.inf, nthreads: int = 0) -> Result:
        """Whether each ray hits anything at ``tnear <= t <= tfar``: (...) bool.

        Parameters
        ----------
        rays : (..., 6) float
        tnear, tfar : float
            In units of the directions' lengths. A ray starts at its origin: ``tnear`` below 0 is 0. (Open3D then finds some of what
            lies behind the origin, and not all of it.)
        """
        origins, directions, shape = _rays(rays)
        ends = {"tmin": max(_arguments.real("tnear", tnear), 0.0), "tmax": _arguments.real("tfar", tfar)}
        return _result(self._scene.occluded(origins, directions, **ends, threads=_threads(nthreads)), *shape)

    def count_intersections(self, rays: Any, nthreads: int = 0) -> Result:
        """How often each ray crosses a triangle: (...) int32. A shared edge or corner is crossed once.

        The border of an open mesh is crossed on half of its sides, by a rule that makes meshes that continue each other be crossed once
        where they meet. A ray that hits it elsewhere crosses nothing, though it hits. Faces that a mesh holds twice, in the same winding, count once.

        Parameters
        ----------
        rays : (..., 6) float
        """
        origins, directions, shape = _rays(rays)
        return _result(self._scene.count(origins, directions, threads=_threads(nthreads)), *shape)

    def list_intersections(self, rays: Any, nthreads: int = 0) -> dict[str, Result]:
        """All crossings of each ray, from near to far: those of :meth:`count_intersections`.

        Parameters
        ----------
        rays : (..., 6) float

        Returns
        -------
        dict
            ray_splits (rays + 1,) uint32: those of ray i are from ``ray_splits[i]`` to ``ray_splits[i + 1]``. ray_ids (m,) uint32.
            t_hit (m,), geometry_ids, primitive_ids (m,) uint32 and primitive_uvs (m, 2) as in :meth:`cast_rays`.

        Raises
        ------
        OverflowError
            Where there are more rays or hits than 32 bits count.
        """
        origins, directions, _ = _rays(rays)
        splits, ray, primitive, geometry, t, uv = self._scene.list(origins, directions, threads=_threads(nthreads))
        return {
            "ray_splits": splits.view(Result),
            "ray_ids": ray.view(Result),
            "t_hit": t.view(Result),
            "geometry_ids": geometry.view(Result),
            "primitive_ids": primitive.view(Result),
            "primitive_uvs": uv.view(Result),
        }

    def compute_closest_points(self, query_points: Any, nthreads: int = 0) -> dict[str, Result]:
        """The point of the meshes that is nearest to each point.

        Parameters
        ----------
        query_points : (..., 3) float

        Returns
        -------
        dict
            points (..., 3); geometry_ids, primitive_ids (...) uint32; primitive_uvs (..., 2) and primitive_normals (..., 3) as in
            :meth:`cast_rays`. For a point that is not finite, or if there are no triangles, ``points`` are NaN, ids
            :attr:`INVALID_ID`, and the others 0.
        """
        points, shape = _points(query_points)
        nearest = self._scene.nearest(points, threads=_threads(nthreads))
        point, primitive, geometry, uv, normal, _ = nearest
        return {
            "points": _result(point.astype(points.dtype, copy=False), *shape, 3),
            "geometry_ids": _result(geometry, *shape),
            "primitive_ids": _result(primitive, *shape),
            "primitive_uvs": _result(uv.astype(points.dtype, copy=False), *shape, 2),
            "primitive_normals": _result(normal.astype(points.dtype, copy=False), *shape, 3),
        }

    def compute_distance(self, query_points: Any, nthreads: int = 0) -> Result:
        """How far each point is from the nearest triangle: (...), NaN for a point that is not finite, or if there are no triangles.

        Parameters
        ----------
        query_points : (..., 3) float
        """
        return self._distance(query_points, nthreads, 0)

    def compute_signed_distance(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Result:
        """The same, negative inside: (...). The meshes must be closed, and not pass through each other.

        Parameters
        ----------
        query_points : (..., 3) float
        nsamples : int
            Rays that vote on where a point is, an odd number. One decides exactly if the meshes are closed.
        """
        return self._distance(query_points, nthreads, _samples(nsamples))

    def _distance(self, query_points: Any, nthreads: int, samples: int) -> Result:
        points, shape = _points(query_points)
        distance = self._scene.distance(points, samples, threads=_threads(nthreads))
        if points.dtype == np.float32:
            # Farther than float32 holds counts as far as it does.
            most = np.finfo(np.float32).max
            np.clip(distance, -most, most, out=distance)
        return _result(distance.astype(points.dtype, copy=False), *shape)

    def compute_occupancy(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Result:
        """1 for each point inside, else 0: (...), in the type of the points.

        Parameters
        ----------
        query_points : (..., 3) float
        nsamples : int
            As in :meth:`compute_signed_distance`.
        """
        points, shape = _points(query_points)
        inside = self._scene.inside(points, _samples(nsamples), threads=_threads(nthreads))
        return _result(inside.astype(points.dtype), *shape)

    @overload
    @staticmethod
    def create_rays_pinhole(
        fov_deg: float, center: Any, eye: Any, up: Any, width_px: int, height_px: int
    ) -> Result: ...

    @overload
    @staticmethod
    def create_rays_pinhole(
        intrinsic_matrix: Any, extrinsic_matrix: Any, width_px: int, height_px: int
    ) -> Result: ...

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> Result:
        """The rays of a pinhole camera: (height_px, width_px, 6) float32.

        Directions reach to depth 1: ``t_hit`` is the depth along the view. With ``fov_deg`` the picture is Open3D's: turned by half a
        turn, the first row at the bottom and seen from the right; ``rays[::-1, ::-1]`` is upright.

        Parameters
        ----------
        fov_deg : float
            Horizontal field of view in degrees.
        center, eye, up : (3,) float
            What the camera looks at, where it is, and what is up.
        width_px, height_px : int
        intrinsic_matrix : (3, 3) float
            Or, instead of the first four: the upper triangular matrix from camera coordinates to pixels,
        extrinsic_matrix : (4, 4) float
            and that from the world to the camera, which looks along its z.
        """
        from ._pinhole import rays_from_matrices, rays_looking_at

        by_matrices = bool({"intrinsic_matrix", "extrinsic_matrix"} & kwargs.keys()) or bool(args and len(args) + len(kwargs) < 5 and np.ndim(args[0]))
        make = rays_from_matrices if by_matrices else rays_looking_at
        return make(*args, **kwargs).view(Result)


def _rays(rays: Any) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
    """Origins, directions, and the shape without the last dimension."""
    array = _arrays.floats("rays", rays, 6)
    flat = array.reshape(-1, 6)
    return flat[:, :3], flat[:, 3:], array.shape[:-1]


def _points(points: Any) -> tuple[np.ndarray, tuple[int, ...]]:
    array = _arrays.floats("query_points", points, 3)
    return array.reshape(-1, 3), array.shape[:-1]


def _threads(nthreads: Any) -> int:
    return _arguments.whole("nthreads", nthreads)


# A majority is settled long before, and nothing is looked at in between.
_MAX_SAMPLES = 9_999


def _samples(nsamples: Any) -> int:
    samples = _arguments.whole("nsamples", nsamples, least=1, most=_MAX_SAMPLES)
    if samples % 2 == 0:
        raise ValueError(f"nsamples must be an odd number, not {samples}")
    return samples


def _mesh(name: str, mesh: Any) -> tuple[Any, Any]:
    """Vertices and triangles of Open3D's mesh, of either kind, or of trimesh's."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        try:
            return mesh.vertex["positions"], mesh.triangle["indices"]
        except KeyError as error:
            raise ValueError(f"{name} must have vertex positions and triangle indices: {error}") from None
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return mesh.vertices, mesh.faces
    if hasattr(mesh, "vertices") and hasattr(mesh, "triangles"):
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    or_else = ", or come with triangle_indices" if name == "vertex_positions" else ""
    raise TypeError(f"{name} must be a mesh of Open3D or trimesh{or_else}; it is a {type(mesh).__name__}")
