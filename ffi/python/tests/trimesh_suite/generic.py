"""What trimesh's tests import as `generic`: its own reads models that its source distribution does not have, so that these stand
for them."""

import logging
import time  # noqa: F401

import numpy as np
import trimesh  # noqa: F401

log = logging.getLogger("trimesh")
_rng = np.random.default_rng(0)


def random(shape):
    return _rng.random(shape)


def _open_torus():
    """Not closed, as the teapot."""
    mesh = trimesh.creation.torus(2, 1)
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.8)
    return mesh


_MODELS = {
    "unit_sphere.STL": lambda: trimesh.creation.icosphere(subdivisions=2),
    "unit_cube.STL": lambda: trimesh.creation.box(),
    "teapot.stl": _open_torus,
    "featuretype.STL": lambda: trimesh.creation.annulus(1, 2, 1).subdivide(),
}


def get_mesh(name, **options):
    mesh = _MODELS[name]()
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, **options)
