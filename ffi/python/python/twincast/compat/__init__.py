"""Stand-ins for other packages."""

from . import embreex

__all__ = ["embreex"]
