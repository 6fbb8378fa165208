"""The command line: ``python -m twincast``, and the console script ``twincast``."""

import sys

from . import _native


def main() -> int:
    """Runs ``twincast`` on the process's own arguments; returns its exit code."""
    return _native.main(["twincast", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
