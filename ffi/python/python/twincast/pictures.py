"""Pictures of scenes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

from . import _arguments, _arrays, _native

#: Diffuse reflectance, linear, of meshes that have no colour.
GREY = (0.7, 0.7, 0.7)

#: Vertices (v, 3), triangles (t, 3) and colour.
_Mesh = tuple[np.ndarray, np.ndarray, tuple[float, float, float]]

#: The most of the numbers that the native part has in 32 bits.
_U32 = 2**32 - 1
# `scene::MAX_DEPTH` of the library.
_MAX_DEPTH = 1000


def render(
    scene: Any,
    *,
    size: tuple[int, int] | None = None,
    spp: int | None = None,
    eye: ArrayLike | None = None,
    look_at: ArrayLike | None = None,
    up: ArrayLike | None = None,
    fov: float | None = None,
    camera: str | None = None,
    integrator: str | None = None,
    max_depth: int | None = None,
    background: ArrayLike | None = None,
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
        pair of such arrays, or several of these. Meshes are grey, whatever colours and textures they have, and lit from the camera.
    size : (width, height), optional
        In pixels; the file's, else 1280 x 720.
    spp : int, optional
        Samples a pixel; the file's, else 4.
    eye, look_at, up : (3,) float, optional
        Where the camera is, what it looks at and what is up (0, 1, 0 where not given), in the coordinates of the scene. Without ``eye``, with
        which the others go, the file's camera, or one that shows everything. Where ``up`` is along the view, up in the picture is what it becomes for a camera that is tilted until it looks up or
        down.
    fov : float, optional
        Vertical field of view in degrees, with ``eye``; 40 where not given.
    camera : str, optional
        The name of one of the file's cameras; not with ``eye``.
    integrator : str, optional
        ray-cast, whitted, path or auto; the file's, else the cheapest that shows all the scene contains.
    max_depth : int, optional
        How often a ray may be sent on, up to 1000.
    background : (3,) float, optional
        Linear RGB behind everything, opaque; the file's, else transparent black.
    seed : int, optional
        Chooses among equally good sample patterns.
    up_axis, unit : str
        Of a file: y or z; m, cm, mm or in. Meshes are taken as they are.
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
    TypeError, ValueError
        Where the scene or an argument is wrong, with what would be right.

    Warns
    -----
    UserWarning
        Of what is odd about a file, but can be rendered.
    """
    render_options = {
        "size": None if size is None else _size(size),
        "spp": None if spp is None else _arguments.whole("spp", spp, least=1, most=_U32),
        "seed": None if seed is None else _arguments.whole("seed", seed, most=2**64 - 1),
        "camera": _arguments.text("camera", camera),
        "integrator": _arguments.text("integrator", integrator),
        "max_depth": None if max_depth is None else _arguments.whole("max_depth", max_depth, most=_MAX_DEPTH),
        "background": None if background is None else _arrays.vector("background", background).tolist(),
        "threads": _arguments.whole("threads", threads),
    }
    if eye is not None and camera is not None:
        raise ValueError("camera must be left out where eye is given: either says where the view is from")
    for name, value in [("up_axis", up_axis), ("unit", unit)]:
        if not isinstance(value, str):
            raise TypeError(f"{name} must be a string, not {value!r}")
    _arguments.text("normals", normals)
    is_file = isinstance(scene, (str, os.PathLike))
    if not is_file and (up_axis, unit) != ("y", "m"):
        raise ValueError("up_axis and unit are those of a file: meshes are taken as they are")
    meshes = None if is_file else _meshes(scene)
    render_options["view"] = _view(meshes, eye, look_at, up, fov)
    if meshes is not None:
        return _native.render_meshes(meshes, render_options, "flat" if normals is None else normals)
    path = os.fspath(scene)
    if not os.path.exists(path):
        raise FileNotFoundError(f"no such scene file: {path}")
    picture, complaints = _native.render_file(path, render_options, up_axis, unit, "file" if normals is None else normals)
    for complaint in complaints:
        warnings.warn(complaint, stacklevel=2)
    return picture


def _view(meshes: list[_Mesh] | None, eye: Any, look_at: Any, up: Any, fov: Any) -> tuple[Any, ...] | None:
    """Eye, target, up and field of view; None where the camera is the scene's. ``meshes`` are None for a file."""
    if eye is None:
        alone = [name for name, value in [("look_at", look_at), ("up", up), ("fov", fov)] if value is not None]
        if alone:
            raise ValueError(f"eye must be given with {' and '.join(alone)}")
        return None
    up = (0.0, 1.0, 0.0) if up is None else up
    fov = 40.0 if fov is None else _arguments.real("fov", fov)
    if not 0 < fov < 180:
        raise ValueError(f"fov must be between 0 and 180, not {fov}")
    target = _centre(meshes) if look_at is None and meshes is not None else look_at
    if target is None:
        raise ValueError("look_at must be given with eye, for a file")
    vectors = (_arrays.vector(name, value).tolist() for name, value in [("eye", eye), ("look_at", target), ("up", up)])
    return (*vectors, fov)


def _meshes(scene: Any) -> list[_Mesh]:
    """One mesh, or several.

    Raises
    ------
    ValueError
        Where there is none.
    """
    meshes = [_mesh(mesh) for mesh in _parts(scene)]
    if not meshes:
        raise ValueError(f"scene must have a mesh; there is none in a {type(scene).__name__}")
    return meshes


def _parts(scene: Any) -> Iterable[Any]:
    if hasattr(scene, "vertices") and hasattr(scene, "faces"):
        return [scene]
    # trimesh's scenes: all meshes where they stand.
    if hasattr(scene, "geometry") and hasattr(scene, "dump"):
        return [mesh for mesh in scene.dump() if hasattr(mesh, "faces")]
    if _is_pair(scene) and not all(_is_pair(part) or hasattr(part, "faces") for part in scene):
        return [scene]
    if isinstance(scene, Iterable):
        return scene
    raise TypeError(f"scene must be a path, a mesh or a list of meshes, not a {type(scene).__name__}")


def _is_pair(value: Any) -> bool:
    """Whether it may be vertices and triangles."""
    return isinstance(value, tuple) and len(value) == 2


def _mesh(mesh: Any) -> _Mesh:
    if _is_pair(mesh):
        vertices, faces = mesh
    elif hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        vertices, faces = mesh.vertices, mesh.faces
    else:
        raise TypeError(f"scene: a mesh must have vertices and faces, or be a pair of these; found a {type(mesh).__name__}")
    vertices = _arrays.vectors("vertices", vertices)
    faces = _arrays.triangles("faces", faces, vertices)
    # Vertices that belong to no triangle show nothing, so they must not count for what the camera shows.
    is_used = np.zeros(len(vertices), dtype=bool)
    is_used[faces] = True
    if not is_used.all():
        vertices, faces = vertices[is_used], (np.cumsum(is_used, dtype=np.uint32) - np.uint32(1))[faces]
    return vertices, faces, GREY


def _centre(meshes: list[_Mesh]) -> np.ndarray:
    corners = np.concatenate([vertices for vertices, _, _ in meshes])
    corners = corners[np.isfinite(corners).all(axis=1)]
    return (corners.min(axis=0) + corners.max(axis=0)) / 2 if len(corners) else np.zeros(3)


def _size(size: Any) -> tuple[int, int]:
    try:
        width, height = size
    except TypeError:
        raise TypeError(f"size must be (width, height), not {size!r}") from None
    except ValueError:
        raise ValueError(f"size must be (width, height), not {size!r}") from None
    return _arguments.whole("size", width, least=1, most=_U32), _arguments.whole("size", height, least=1, most=_U32)
