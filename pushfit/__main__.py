"""`python -m pushfit`, and the `pushfit` script.

Excluded: the commands (`pushfit.cli.app`).
"""

import atexit
import gc
import os
import sys

# Objects between two searches for garbage.
GARBAGE = 1_000_000
# Threads of NumPy's linear algebra: matrices are small, and threads that wait for
# larger ones take a core from those that work.
BLAS_THREADS = "OPENBLAS_NUM_THREADS", "1"
# What the process ends with.
_exit_code = [1]


def main() -> int:
    """Run one command; an interruption while it is still being loaded has its code."""
    # The first one that is registered is the last one that runs.
    atexit.register(_leave)
    # Imports leave hardly any garbage, and looking for it takes a third of a second.
    gc.set_threshold(GARBAGE)
    os.environ.setdefault(*BLAS_THREADS)
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
