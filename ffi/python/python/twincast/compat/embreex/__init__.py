"""A stand-in for the package embreex, over Twincast's tracer.

>>> from twincast.compat import embreex
>>> embreex.install()

After that ``import embreex`` finds this package, and trimesh's Embree backend runs on it. What is better than in embreex: queries
run on all cores, shapes are checked, meshes may be added after a query, and float64 vertices and rays are not rounded.
"""

from __future__ import annotations

import sys

from . import mesh_construction, rtcore, rtcore_scene

__all__ = ["install", "mesh_construction", "rtcore", "rtcore_scene", "uninstall"]

#: The version of embreex whose interface this is.
__version__ = "4.4.0+twincast"

_MODULES = ("", ".mesh_construction", ".rtcore", ".rtcore_scene")

#: What stood in ``sys.modules`` before.
_replaced: dict[str, object] = {}


def install() -> None:
    """Lets ``import embreex`` find this package, until :func:`uninstall`.

    To be called before trimesh is imported, which looks for embreex once.

    Raises
    ------
    RuntimeError
        Where trimesh has been imported with another Embree backend, or without one: it would go on with that.
    """
    if sys.modules.get("embreex") is sys.modules[__name__]:
        return
    if "trimesh.ray" in sys.modules:
        raise RuntimeError("twincast.compat.embreex.install() must be called before trimesh is imported")
    for suffix in _MODULES:
        name = "embreex" + suffix
        if name in sys.modules:
            _replaced[name] = sys.modules[name]
        sys.modules[name] = sys.modules[__name__ + suffix]


def uninstall() -> None:
    """Puts back what :func:`install` replaced. What was imported meanwhile keeps the stand-in."""
    for suffix in _MODULES:
        name = "embreex" + suffix
        if sys.modules.get(name) is sys.modules[__name__ + suffix]:
            del sys.modules[name]
            if name in _replaced:
                sys.modules[name] = _replaced.pop(name)  # type: ignore[assignment]
