"""embreex's scenes."""

from __future__ import annotations

import numbers
from typing import Any

import numpy as np

from ... import _arrays
from ..._meshes import Meshes
from .rtcore import EmbreeDevice

#: How far rays reach if nobody says; in float32, as embreex has it.
_FARTHEST = float(np.float32(1e37))

_QUERIES = ("INTERSECT", "OCCLUDED", "DISTANCE")


class EmbreeScene(Meshes):
    """Meshes that rays can be cast at; see :mod:`~twincast.compat.embreex.mesh_construction` for how they get in.

    Parameters
    ----------
    device : EmbreeDevice, optional
        Ignored.
    robust : bool
        Ignored: no ray passes between two triangles that share an edge, whether it is asked for or not.
    """

    def __init__(self, device: EmbreeDevice | None = None, robust: bool = True) -> None:
        super().__init__()
        self.device = EmbreeDevice() if device is None else device

    @property
    def is_committed(self) -> int:
        """1 if the tree over all meshes is built, else 0."""
        return int(self._is_built)

    def run(
        self,
        vec_origins: Any,
        vec_directions: Any,
        dists: Any = None,
        query: str = "INTERSECT",
        output: Any = None,
    ) -> np.ndarray | dict[str, np.ndarray]:
        """Casts rays.

        Parameters
        ----------
        vec_origins : (n, 3) float
        vec_directions : (n, 3) or (1, 3) float
            One row serves all rays. ``dists`` are in units of their length.
        dists : float or (n,) float32, optional
            How far rays reach; 1e37 if not given. With ``output``, or for DISTANCE, an array is overwritten by the hits' distances.
        query : str
            INTERSECT, OCCLUDED or DISTANCE.
        output : optional
            If true, the nearest hits with everything that is known of them, whatever ``query`` is.

        Returns
        -------
        (n,) int32
            For INTERSECT the triangle in its mesh, or -1; for OCCLUDED 0 where anything is hit, or -1.
        (n,) float32
            For DISTANCE how far the nearest hit is; where there is none, what ``dists`` says.
        dict
            With ``output``: u, v, tfar (n,) and Ng (n, 3) float32, the normal not of unit length; primID, geomID (n,) int32.
        """
        if query not in _QUERIES:
            raise ValueError(
                f"Embree ray query type {query} not recognized.\nAccepted types are ({','.join(_QUERIES)})"
            )
        origins = _arrays.vectors("vec_origins", vec_origins)
        directions = _arrays.vectors("vec_directions", vec_directions)
        if len(directions) not in (1, len(origins)):
            raise ValueError(f"vec_directions: {len(directions)} of them, but {len(origins)} vec_origins")
        reach, overwrite = _reach(dists, len(origins))
        if overwrite is not None and (output or query == "DISTANCE") and not overwrite.flags.writeable:
            raise ValueError("dists must be writeable: the hits' distances are written there")
        scene = self._scene
        if output:
            t, uv, primitive, geometry, normal = scene.cast(origins, directions, tmax=reach, normalize=False)
            tfar = _distances(t, reach, overwrite)
            u, v = np.ascontiguousarray(uv[:, 0]), np.ascontiguousarray(uv[:, 1])
            ids = {"primID": primitive.view(np.int32), "geomID": geometry.view(np.int32)}
            return {"u": u, "v": v, "Ng": normal, "tfar": tfar, **ids}
        if query == "INTERSECT":
            return scene.first(origins, directions, tmax=reach).astype(np.int32)
        if query == "OCCLUDED":
            return scene.occluded(origins, directions, tmax=reach).astype(np.int32) - np.int32(1)
        return _distances(scene.cast(origins, directions, tmax=reach)[0], reach, overwrite)


def _reach(dists: Any, count: int) -> tuple[float | np.ndarray, np.ndarray | None]:
    """How far rays reach, and the array that is to be overwritten."""
    if dists is None:
        return _FARTHEST, None
    if isinstance(dists, numbers.Real):
        return float(np.float32(dists)), None
    reach = _arrays.floats("dists", dists)
    if reach.shape != (count,):
        raise ValueError(f"dists must have the shape ({count},), not {reach.shape}")
    is_theirs = isinstance(dists, np.ndarray) and dists.dtype.newbyteorder("=") == np.float32
    return reach, dists if is_theirs else None


def _distances(t: np.ndarray, reach: float | np.ndarray, overwrite: np.ndarray | None) -> np.ndarray:
    """The hits' distances, and where there is none how far the ray reached."""
    distances = np.where(np.isfinite(t), t, np.asarray(reach, dtype=np.float32))
    if overwrite is None:
        return distances
    overwrite[...] = distances
    return overwrite
