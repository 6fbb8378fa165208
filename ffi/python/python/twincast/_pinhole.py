"""Rays of pinhole cameras, as Open3D makes them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from . import _arrays


def rays_looking_at(
    fov_deg: float, center: Any, eye: Any, up: Any, width_px: int, height_px: int
) -> np.ndarray:
    """See :meth:`twincast.RaycastingScene.create_rays_pinhole`."""
    if not 0 < fov_deg < 180:
        raise ValueError(f"fov_deg must be between 0 and 180, not {fov_deg}")
    center, eye, up = (_vector(name, v) for name, v in [("center", center), ("eye", eye), ("up", up)])
    ahead = center - eye
    # Open3D's camera has x to the left and y up, so that its pictures are turned by half a turn; who is used to that turns them back.
    left = np.cross(up, ahead)
    if not np.linalg.norm(left) > 0:
        raise ValueError("center, eye and up: they must be finite, and not lie on one line")
    axes = np.array([axis / np.linalg.norm(axis) for axis in (left, np.cross(ahead, left), ahead)])
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = axes
    extrinsic[:3, 3] = -axes @ eye
    focal = width_px / 2 / math.tan(math.radians(fov_deg) / 2)
    intrinsic = np.array([[focal, 0, width_px / 2], [0, focal, height_px / 2], [0, 0, 1]])
    return rays_from_matrices(intrinsic, extrinsic, width_px, height_px)


def rays_from_matrices(
    intrinsic_matrix: Any, extrinsic_matrix: Any, width_px: int, height_px: int
) -> np.ndarray:
    """See :meth:`twincast.RaycastingScene.create_rays_pinhole`."""
    intrinsic = _matrix("intrinsic_matrix", intrinsic_matrix, 3)
    extrinsic = _matrix("extrinsic_matrix", extrinsic_matrix, 4)
    if width_px < 1 or height_px < 1:
        raise ValueError(f"width_px and height_px must be at least 1, not {width_px} and {height_px}")
    # Through the pixels' middles.
    x, y = np.meshgrid(np.arange(width_px) + 0.5, np.arange(height_px) + 0.5)
    to_world = extrinsic[:3, :3].T @ np.linalg.inv(intrinsic)
    rays = np.empty((height_px, width_px, 6), dtype=np.float32)
    rays[..., :3] = -extrinsic[:3, :3].T @ extrinsic[:3, 3]
    rays[..., 3:] = np.stack([x, y, np.ones_like(x)], axis=-1) @ to_world.T
    return rays


def _vector(name: str, value: Any) -> np.ndarray:
    vector = _arrays.floats(name, value, 3).astype(np.float64)
    if vector.shape != (3,):
        raise ValueError(f"{name} must have the shape (3,), not {vector.shape}")
    return vector


def _matrix(name: str, value: Any, size: int) -> np.ndarray:
    matrix = _arrays.floats(name, value, size).astype(np.float64)
    if matrix.shape != (size, size):
        raise ValueError(f"{name} must have the shape ({size}, {size}), not {matrix.shape}")
    return matrix
