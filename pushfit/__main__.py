"""`python -m pushfit`, and the `pushfit` script."""

import atexit
import gc
import os
import sys

# Objects between two searches for garbage.
GARBAGE = 100_000
# What the process ends with.
_exit_code = [1]


def main() -> int:
    """Run one command; an interruption while it is still being loaded has its code."""
    # The first one that is registered is the last one that runs.
    atexit.register(_leave)
    # Imports leave hardly any garbage, and looking for it takes a third of a second.
    gc.set_threshold(GARBAGE)
    try:
        from pushfit.cli import main as run

        _exit_code[0] = run()
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        _exit_code[0] = 130
    return _exit_code[0]


def _leave() -> None:
    """End without freeing programs one by one, which would take most of a second."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(_exit_code[0])


if __name__ == "__main__":
    sys.exit(main())
