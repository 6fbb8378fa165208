"""Exact ray casting on triangle meshes.

Four ways in, all over one native tracer:

- :class:`RayMeshIntersector`: trimesh's ray interface (``mesh.ray = twincast.RayMeshIntersector(mesh)``);
- :class:`RaycastingScene`: Open3D's, on NumPy and DLPack arrays;
- :mod:`twincast.compat.embreex`: stands in for the package embreex;
- :func:`render`: a scene file, or meshes, to a picture.

Whether a ray hits a triangle is decided exactly for the numbers that were given, f32 or f64. No ray passes between two
triangles that share an edge, and each crossing counts once. Queries run on all cores without the interpreter's lock.
"""

from . import compat
from ._native import ISA, __version__
from .intersector import RayMeshIntersector
from .pictures import render
from .raycasting import RaycastingScene

__all__ = ["ISA", "RayMeshIntersector", "RaycastingScene", "__version__", "compat", "render"]
