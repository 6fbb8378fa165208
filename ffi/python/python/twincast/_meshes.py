"""Meshes that are added one by one."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from . import _arguments, _native


#: Attributes that deep copies have in common, or have of their own as it is.
_SHARED = {"_threads", "_meshes", "_built"}


class Meshes:
    """Meshes in the order in which they came, and the tree over them, which is built at the first query after the last of them.

    Copies share the arrays, which nobody changes, and the tree, but what is added to one is not in the other. What else a subclass has
    is shared by copies, and not by deep ones. The tree is not pickled: it is built again at the first query.
    """

    def __init__(self, threads: Any = 0) -> None:
        self._threads = _arguments.whole("nthreads", threads)
        self._meshes: list[tuple[np.ndarray, np.ndarray]] = []
        # With how many meshes it was built: one may be added while another thread builds.
        self._built: tuple[int, _native.Scene] | None = None

    def _add(self, vertices: np.ndarray, triangles: np.ndarray) -> int:
        """The number of a new mesh: vertices (v, 3), triangles (t, 3) uint32. What the caller does with them afterwards does not concern it."""
        mesh = (vertices.copy(), triangles.copy())
        self._meshes.append(mesh)
        # Another thread may have added one since.
        return next(number for number in reversed(range(len(self._meshes))) if self._meshes[number] is mesh)

    @property
    def _is_built(self) -> bool:
        built = self._built
        return built is not None and built[0] == len(self._meshes)

    @property
    def _scene(self) -> _native.Scene:
        meshes = list(self._meshes)
        built = self._built
        if built is None or built[0] != len(meshes):
            built = self._built = (len(meshes), _native.Scene(meshes, self._threads))
        return built[1]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_built": None}

    def __copy__(self) -> Meshes:
        twin = object.__new__(type(self))
        # The tree first: it may be too old for the list, never too new.
        built = self._built
        twin.__dict__.update(self.__dict__, _built=built, _meshes=list(self._meshes))
        return twin

    def __deepcopy__(self, memo: dict[int, Any]) -> Meshes:
        twin = memo[id(self)] = Meshes.__copy__(self)
        for name in twin.__dict__.keys() - _SHARED:
            twin.__dict__[name] = copy.deepcopy(twin.__dict__[name], memo)
        return twin
