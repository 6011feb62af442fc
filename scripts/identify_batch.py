"""Identify every recording or table named, as `pushfit batch` does.

    python scripts/identify_batch.py INPUT... --out DIR [--workers N]

A start for a driver of one's own: everything is in the one library call.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import pushfit


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("inputs", nargs="+", help="files, folders and patterns")
    parser.add_argument("--out", type=Path, required=True, help="folder of results")
    parser.add_argument("--config", type=Path, help="grasp.toml")
    parser.add_argument("--schedule", type=Path, help="directions of the pushes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--scheduler", help="address of a running dask scheduler")
    options = parser.parse_args(argv)
    try:
        found = pushfit.identify_batch(
            options.inputs,
            options.out,
            config=options.config,
            schedule=options.schedule,
            seed=options.seed,
            workers=pushfit.Workers(n=options.workers, scheduler=options.scheduler),
        )
    except pushfit.PushfitError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    for failure in found.failures:
        print(f"{failure.item}: {failure.message}", file=sys.stderr)
    print(f"{len(found.rows)} items, {len(found.failures)} failures")
    return 5 if found.failures else 0


# Worker processes import this file; only the first one runs it.
if __name__ == "__main__":
    sys.exit(main())
