"""`python -m pushfit`, and the `pushfit` script."""

import sys


def main() -> int:
    """Run one command; an interruption while it is still being loaded has its code."""
    try:
        from pushfit.cli import main as run

        return run()
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
