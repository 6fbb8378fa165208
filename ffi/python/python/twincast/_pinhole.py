"""Rays of pinhole cameras, as Open3D makes them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import _arguments, _arrays


def rays_looking_at(
    fov_deg: float, center: Any, eye: Any, up: Any, width_px: int, height_px: int
) -> np.ndarray:
    """See :meth:`twincast.RaycastingScene.create_rays_pinhole`."""
    fov_deg = _arguments.real("fov_deg", fov_deg)
    width_px, height_px = _size(width_px, height_px)
    if not 0 < fov_deg < 180:
        raise ValueError(f"fov_deg must be between 0 and 180, not {fov_deg}")
    center, eye, up = (_arrays.vector(name, v) for name, v in [("center", center), ("eye", eye), ("up", up)])
    ahead, up = (_to_size(vector) for vector in (center - eye, up))
    # Open3D's camera has x to the left and y up, so that its pictures are turned by half a turn; who is used to that turns them back.
    left = np.cross(up, ahead)
    if not np.linalg.norm(left) > 0:
        raise ValueError("center, eye and up: the view must have a direction, and up another")
    axes = np.array([axis / np.linalg.norm(axis) for axis in (left, np.cross(ahead, left), ahead)])
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = axes
    extrinsic[:3, 3] = -axes @ eye
    focal = width_px / 2 / math.tan(math.radians(fov_deg) / 2)
    intrinsic = np.array([[focal, 0, width_px / 2], [0, focal, height_px / 2], [0, 0, 1]])
    return rays_from_matrices(intrinsic, extrinsic, width_px, height_px)


def _to_size(vector: np.ndarray) -> np.ndarray:
    """The same direction, of a length whose square a float holds."""
    size = np.abs(vector).max()
    return vector / size if size > 0 else vector


def rays_from_matrices(
    intrinsic_matrix: Any, extrinsic_matrix: Any, width_px: int, height_px: int
) -> np.ndarray:
    """See :meth:`twincast.RaycastingScene.create_rays_pinhole`."""
    intrinsic = _arrays.matrix("intrinsic_matrix", intrinsic_matrix, 3)
    extrinsic = _arrays.matrix("extrinsic_matrix", extrinsic_matrix, 4)
    width_px, height_px = _size(width_px, height_px)
    try:
        to_camera = np.linalg.inv(intrinsic)
    except np.linalg.LinAlgError:
        raise ValueError(f"intrinsic_matrix must have an inverse; it is {intrinsic.tolist()}") from None
    # Through the pixels' middles.
    x, y = np.meshgrid(np.arange(width_px) + 0.5, np.arange(height_px) + 0.5)
    to_world = extrinsic[:3, :3].T @ to_camera
    if not np.linalg.det(extrinsic[:3, :3]):
        raise ValueError(f"extrinsic_matrix must have an inverse; it is {extrinsic.tolist()}")
    centre = -extrinsic[:3, :3].T @ extrinsic[:3, 3]
    if not np.abs(centre).max() <= np.finfo(np.float32).max:
        raise ValueError(f"the camera is at {centre.tolist()}, which is more than float32 holds")
    rays = np.empty((height_px, width_px, 6), dtype=np.float32)
    rays[..., :3] = centre
    rays[..., 3:] = np.stack([x, y, np.ones_like(x)], axis=-1) @ to_world.T
    return rays


def _size(width_px: Any, height_px: Any) -> tuple[int, int]:
    return _arguments.whole("width_px", width_px, least=1), _arguments.whole("height_px", height_px, least=1)


# What Python says of an argument that neither has is said of the method.
for _rays in (rays_looking_at, rays_from_matrices):
    _rays.__qualname__ = "create_rays_pinhole"
