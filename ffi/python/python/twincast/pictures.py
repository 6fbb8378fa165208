"""Pictures of scenes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from . import _arrays, _native

#: Diffuse reflectance, linear, of meshes that have no colour.
GREY = (0.7, 0.7, 0.7)


def render(
    scene: Any,
    *,
    size: tuple[int, int] | None = None,
    spp: int | None = None,
    eye: Sequence[float] | None = None,
    look_at: Sequence[float] | None = None,
    up: Sequence[float] = (0.0, 1.0, 0.0),
    fov: float = 40.0,
    camera: str | None = None,
    integrator: str | None = None,
    max_depth: int | None = None,
    background: Sequence[float] | None = None,
    seed: int | None = None,
    up_axis: str = "y",
    unit: str = "m",
    normals: str | None = None,
    threads: int = 0,
) -> np.ndarray:
    """Renders a scene.

    Parameters
    ----------
    scene : path or mesh or meshes
        A file (.glb, .gltf, .obj, .ply, .stl, .toml, .nff, .test); or a mesh: anything with ``vertices`` (v, 3) and ``faces`` (t, 3), a
        pair of such arrays, or a list of these. Meshes are lit from the camera.
    size : (width, height), optional
        In pixels; the file's, else 1280 x 720.
    spp : int, optional
        Samples a pixel; the file's, else 4.
    eye, look_at, up : (3,) float, optional
        Where the camera is, what it looks at and what is up, in the coordinates of the scene. Without ``eye`` the file's camera, or one that
        shows everything.
    fov : float
        Vertical field of view in degrees, with ``eye``.
    camera : str, optional
        The name of one of the file's cameras.
    integrator : str, optional
        ray-cast, whitted, path or auto; the file's, else the cheapest that shows all the scene contains.
    max_depth : int, optional
        How often a ray may be sent on.
    background : (3,) float, optional
        Linear RGB behind everything, opaque; the file's, else transparent black.
    seed : int, optional
        Chooses among equally good sample patterns.
    up_axis, unit : str
        Of a file: y or z; m, cm, mm or in.
    normals : str, optional
        flat or smooth; for a file also "file", what it says, which is usual.
    threads : int
        0 is one for each core.

    Returns
    -------
    (height, width, 4) float32
        Linear RGB (Rec. 709), multiplied by alpha, and alpha; rows from the top.

    Raises
    ------
    FileNotFoundError
        Where there is no such file.
    ValueError
        Where the scene or an argument is wrong, with what would be right.

    Warns
    -----
    UserWarning
        Of what is odd about a file, but can be rendered.
    """
    is_file = isinstance(scene, (str, os.PathLike))
    meshes = None if is_file else [_mesh(mesh) for mesh in _meshes(scene)]
    view = None
    if eye is not None:
        target = _centre(meshes) if look_at is None and meshes is not None else look_at
        if target is None:
            raise ValueError("look_at must be given with eye, for a file")
        view = (_vector("eye", eye), _vector("look_at", target), _vector("up", up), float(fov))
    elif look_at is not None:
        raise ValueError("eye must be given with look_at")
    wishes = {
        "size": None if size is None else _size(size),
        "spp": spp,
        "seed": seed,
        "view": view,
        "camera": camera,
        "integrator": integrator,
        "max_depth": max_depth,
        "background": None if background is None else _vector("background", background),
        "threads": threads,
    }
    if meshes is not None:
        return _native.render_meshes(meshes, wishes, normals or "flat")
    path = os.fspath(scene)
    if not os.path.exists(path):
        raise FileNotFoundError(f"no such scene file: {path}")
    picture, complaints = _native.render_file(path, wishes, up_axis, unit, normals or "file")
    for complaint in complaints:
        warnings.warn(complaint, stacklevel=2)
    return picture


def _meshes(scene: Any) -> Iterable[Any]:
    """One mesh, or several."""
    if hasattr(scene, "vertices") and hasattr(scene, "faces"):
        return [scene]
    # trimesh's scenes: all meshes where they stand.
    if hasattr(scene, "geometry") and hasattr(scene, "dump"):
        return [mesh for mesh in scene.dump() if hasattr(mesh, "faces")]
    if isinstance(scene, tuple) and len(scene) == 2:
        return [scene]
    if isinstance(scene, Iterable):
        return scene
    raise TypeError(f"scene must be a path, a mesh or a list of meshes, not a {type(scene).__name__}")


def _mesh(mesh: Any) -> tuple[np.ndarray, np.ndarray, tuple[float, float, float]]:
    """Vertices, triangles and colour."""
    if isinstance(mesh, tuple) and len(mesh) == 2:
        vertices, faces = mesh
    elif hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        vertices, faces = mesh.vertices, mesh.faces
    else:
        raise TypeError(f"scene: a mesh must have vertices and faces, or be a pair of these; found a {type(mesh).__name__}")
    return _arrays.vectors("vertices", vertices), _arrays.indices("faces", faces), GREY


def _centre(meshes: list[tuple[np.ndarray, np.ndarray, Any]]) -> np.ndarray | None:
    corners = [vertices for vertices, _, _ in meshes if len(vertices)]
    if not corners:
        return np.zeros(3)
    low = np.min([vertices.min(axis=0) for vertices in corners], axis=0)
    high = np.max([vertices.max(axis=0) for vertices in corners], axis=0)
    return (low + high) / 2


def _vector(name: str, value: Sequence[float]) -> list[float]:
    vector = _arrays.floats(name, value, 3)
    if vector.shape != (3,):
        raise ValueError(f"{name} must have the shape (3,), not {vector.shape}")
    return [float(x) for x in vector]


def _size(size: tuple[int, int]) -> tuple[int, int]:
    width, height = size
    if width < 1 or height < 1:
        raise ValueError(f"size must be at least 1 x 1, not {width} x {height}")
    return int(width), int(height)
