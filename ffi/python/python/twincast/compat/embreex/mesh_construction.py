"""embreex's meshes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import _arrays
from .rtcore_scene import EmbreeScene

#: Corners of the triangles of a hexahedron, two a face; its corners are numbered around the bottom, then around the top.
_HEXAHEDRON = np.array(
    [
        *[(0, 2, 1), (0, 3, 2)],
        *[(4, 5, 6), (4, 6, 7)],
        *[(0, 1, 5), (0, 5, 4)],
        *[(1, 2, 6), (1, 6, 5)],
        *[(0, 7, 3), (0, 4, 7)],
        *[(3, 6, 2), (3, 7, 6)],
    ]
)

#: Of a tetrahedron.
_TETRAHEDRON = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


class TriangleMesh:
    """Triangles, added to ``scene``.

    Parameters
    ----------
    scene : EmbreeScene
    vertices : (v, 3) float, or (t, 3, 3) float without ``indices``
    indices : (t, 3) int, optional
        Or floats that hold whole numbers, here and in :class:`ElementMesh`.
    """

    def __init__(self, scene: EmbreeScene, vertices: Any, indices: Any = None) -> None:
        if indices is None:
            corners = _arrays.floats("vertices", vertices, 3)
            if corners.ndim != 3 or corners.shape[1] != 3:
                raise ValueError(f"vertices must have the shape (t, 3, 3) without indices, not {corners.shape}")
            triangles = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
            _add(self, scene, corners.reshape(-1, 3), triangles)
        else:
            _add(self, scene, _arrays.vectors("vertices", vertices), _arrays.whole("indices", indices))


class ElementMesh:
    """The sides of tetrahedra (four triangles each) or hexahedra (twelve), added to ``scene``.

    Parameters
    ----------
    scene : EmbreeScene
    vertices : (v, 3) float
    indices : (e, 4) or (e, 8) int
    """

    def __init__(self, scene: EmbreeScene, vertices: Any, indices: Any) -> None:
        indices = _arrays.whole("indices", indices)
        shape = np.shape(indices)
        if len(shape) != 2 or shape[1] not in (4, 8):
            raise ValueError(f"indices must have the shape (e, 4) or (e, 8), not {shape}")
        elements = _arrays.indices("indices", indices, shape[1])
        corners = _TETRAHEDRON if shape[1] == 4 else _HEXAHEDRON
        _add(self, scene, _arrays.vectors("vertices", vertices), elements[:, corners].reshape(-1, 3))


def _add(mesh: Any, scene: EmbreeScene, vertices: np.ndarray, triangles: Any) -> None:
    if not isinstance(scene, EmbreeScene):
        raise TypeError(f"scene must be an EmbreeScene, not {type(scene).__name__}")
    mesh.geomID = scene._add(vertices, _arrays.triangles("indices", triangles, vertices))
