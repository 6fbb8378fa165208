"""Every triangle against every ray, in NumPy, with f64 that rounds nothing.

Coordinates are small whole numbers times one power of two, plus an offset that f64 holds exactly. Differences of such coordinates, and
products of three of them, then fit into 53 bits: volumes have the right sign, also where it is zero.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

#: Coordinates are whole numbers from -GRID to GRID.
GRID = 256


def soup(rng: np.random.Generator, triangles: int, size: int = GRID // 4) -> tuple[np.ndarray, np.ndarray]:
    """Triangles that share vertices and pass through each other: whole vertices, and indices."""
    vertices = rng.integers(-GRID, GRID + 1, (triangles, 3))
    near = rng.integers(-size, size + 1, (triangles, 2, 3))
    corners = np.concatenate([vertices[:, None], np.clip(vertices[:, None] + near, -GRID, GRID)], axis=1)
    unique, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return unique, faces.reshape(-1, 3)


def rays(rng: np.random.Generator, vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays at random points, at corners, at middles of edges, and along axes: whole origins and directions."""
    origins = 2 * rng.integers(-GRID, GRID + 1, (count, 3))
    corners = vertices[faces[rng.integers(0, len(faces), count)]]
    kind = rng.integers(0, 4, count)[:, None]
    targets = np.where(kind == 0, 2 * corners[:, 0], rng.integers(-2 * GRID, 2 * GRID + 1, (count, 3)))
    targets = np.where(kind == 1, corners[:, 0] + corners[:, 1], targets)
    along = np.eye(3, dtype=np.int64)[rng.integers(0, 3, count)] * rng.choice([-1, 1], (count, 1))
    directions = np.where(kind == 2, along, targets - origins)
    directions[(directions == 0).all(axis=1)] = (1, 2, 3)
    # Half of a grid step, where middles of edges are: all is doubled.
    return origins, directions


def intersect(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of whole numbers: (rays, triangles) whether the line hits, whether in the interior, and t (NaN for none)."""
    a, b, c = (vertices[faces[:, k]][None].astype(np.float64) - origins[:, None] for k in range(3))
    d = directions[:, None].astype(np.float64)

    def volume(p, q):
        return np.sum(d * np.cross(p, q), axis=-1)

    u, v, w = volume(b, c), volume(c, a), volume(a, b)
    total = u + v + w
    same = ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0))
    hit = same & (total != 0)
    interior = hit & (u != 0) & (v != 0) & (w != 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.sum(a * np.cross(b - a, c - a), axis=-1) / total
    return hit & (t >= 0), interior & (t >= 0), np.where(hit, t, np.nan)


def exactly(
    corners: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> tuple[Fraction, Fraction, Fraction] | None:
    """t, u and v of one ray and one triangle, whatever their numbers are; none for a miss, or where all is in one plane."""
    a, b, c, o, d = ([Fraction(float(x)) for x in row] for row in (*corners, origin, direction))

    def minus(p, q):
        return [x - y for x, y in zip(p, q)]

    def cross(p, q):
        return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]

    def dot(p, q):
        return sum(x * y for x, y in zip(p, q))

    second, third, start = minus(b, a), minus(c, a), minus(o, a)
    across = cross(d, third)
    slope = dot(across, second)
    if slope == 0:
        return None
    around = cross(start, second)
    t, u, v = dot(around, third) / slope, dot(start, across) / slope, dot(d, around) / slope
    return (t, u, v) if min(t, u, v, 1 - u - v) >= 0 else None


def nearest(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(points, triangles) distances in f64."""
    p = points[:, None]
    a, b, c = (vertices[faces[:, k]][None] for k in range(3))
    best = np.full((len(points), len(faces)), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = np.sum(edge * edge, axis=-1)
        share = np.clip(np.sum((p - start) * edge, axis=-1) / np.where(length > 0, length, 1), 0, 1)
        best = np.minimum(best, np.linalg.norm(start + share[..., None] * edge - p, axis=-1))
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=-1)
    inside = size > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside = inside & (np.sum(normal * np.cross(end - start, p - start), axis=-1) >= 0)
    height = np.abs(np.sum((p - a) * normal, axis=-1)) / np.where(size > 0, size, 1)
    return np.where(inside, np.minimum(best, height), best)
