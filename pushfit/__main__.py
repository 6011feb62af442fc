"""`python -m pushfit`: the same as the command `pushfit`."""

import sys

from pushfit.cli import main

if __name__ == "__main__":
    sys.exit(main())
