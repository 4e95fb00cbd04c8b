"""The program of a measuring process: ``python -m anglecam.batch.child PARENT``, with the process id of its parent.

It loads the libraries that measure, which takes a second, only when it is certain to end with its parent.
"""

from __future__ import annotations

import sys

from anglecam.end_with_parent import end_with_parent


def main() -> None:
    """Answer requests until the parent is gone."""
    end_with_parent(int(sys.argv[1]))
    from anglecam.batch.serve import serve

    serve()


if __name__ == "__main__":
    main()
