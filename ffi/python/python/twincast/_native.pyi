"""The native part; shapes and types are those that `twincast`'s own functions hand on."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str
DEBUG_ASSERTIONS: bool  # Whether it is a build for tests, which is slower.
ISA: str  # The most that kernels may use of the processor's instructions.

_Floats = NDArray[np.float32] | NDArray[np.float64]
_Ids = NDArray[np.uint32]

class Scene:
    def __new__(cls, meshes: Sequence[tuple[_Floats, _Ids]], threads: int = 0) -> Scene: ...
    def first(
        self, origins: _Floats, directions: _Floats, tmin: float = 0.0, tmax: float | _Floats = ..., threads: int = 0
    ) -> NDArray[np.int64]: ...
    def occluded(
        self, origins: _Floats, directions: _Floats, tmin: float = 0.0, tmax: float | _Floats = ..., threads: int = 0
    ) -> NDArray[np.bool_]: ...
    def cast(
        self,
        origins: _Floats,
        directions: _Floats,
        tmin: float = 0.0,
        tmax: float | _Floats = ...,
        normalize: bool = True,
        threads: int = 0,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], _Ids, _Ids, NDArray[np.float32]]: ...
    def closest(
        self, origins: _Floats, directions: _Floats, tmin: float = 0.0, tmax: float | _Floats = ..., threads: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]: ...
    def normals(self, geometry: _Ids, primitive: _Ids, threads: int = 0) -> NDArray[np.float64]: ...
    def count(
        self, origins: _Floats, directions: _Floats, tmin: float = 0.0, tmax: float | _Floats = ..., threads: int = 0
    ) -> NDArray[np.int32]: ...
    def crossings(
        self,
        origins: _Floats,
        directions: _Floats,
        tmin: float = 0.0,
        tmax: float | _Floats = ...,
        most: int = ...,
        locations: bool = False,
        threads: int = 0,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]: ...
    def list(
        self, origins: _Floats, directions: _Floats, tmin: float = 0.0, tmax: float | _Floats = ..., threads: int = 0
    ) -> tuple[_Ids, _Ids, _Ids, _Ids, _Floats, _Floats]: ...
    def nearest(
        self, points: _Floats, threads: int = 0
    ) -> tuple[
        NDArray[np.float64], _Ids, _Ids, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
    ]: ...
    def distance(self, points: _Floats, samples: int = 0, threads: int = 0) -> NDArray[np.float64]: ...
    def inside(
        self, points: _Floats, samples: int = 1, both_ways: bool = False, threads: int = 0
    ) -> NDArray[np.bool_]: ...

def render_file(
    path: str, render_options: dict[str, Any], up_axis: str = "y", unit: str = "m", normals: str = "file"
) -> tuple[NDArray[np.float32], list[str]]: ...
def render_meshes(
    meshes: Sequence[tuple[_Floats, _Ids, Sequence[float]]], render_options: dict[str, Any], normals: str = "flat"
) -> NDArray[np.float32]: ...
def main(arguments: Sequence[str]) -> int: ...
