"""embreex's devices: there is nothing to choose, so that one is as good as another."""

from __future__ import annotations


class EmbreeDevice:
    """Something that scenes may be given."""

    def __repr__(self) -> str:
        from ... import ISA, __version__

        return f"EmbreeDevice: Twincast {__version__}, {ISA}"
