"""A cheap stand-in for `identify_many`, importable in worker processes.

What it does to a table goes by words in the name of its file: reject, bug, kill,
killonce, hang. Every table that it computes leaves a line in the log.
"""

import os
import signal
import time
from pathlib import Path

import numpy as np

from pushfit.batch.run import identify_batch
from pushfit.errors import DataError
from pushfit.fit.identify.identify_many import ItemResult

# Names of environment variables.
LOG, SECONDS = "FAKE_LOG", "FAKE_SECONDS"


def identify(tables, config, *, seeds, engine):
    """Rows that depend on the table, the config and the seed alone."""
    found = [
        one(table, config, seed) for table, seed in zip(tables, seeds, strict=True)
    ]
    time.sleep(float(os.environ.get(SECONDS, "0")))
    return found


def one(table, config, seed):
    name = Path(table.sources[0].path).name
    misbehave(name)
    log(name)
    if "reject" in name:
        return DataError(f"{name}: rejected", code="rejected")
    rng = np.random.default_rng(seed)
    heights = table.heights("height")
    values = {
        "status": "ok",
        "theta_c_deg": float(heights.mean() + rng.normal()),
        "theta_c_low_deg": None,
        "push_length_mm": config.push.length_mm,
        "n_pushes": table.n_pushes,
        "engine": "fake",
    }
    return ItemResult(values=values, draws={"theta_c_deg": rng.normal(size=5)})


def misbehave(name):
    if "bug" in name:
        raise ZeroDivisionError("bug")
    if "hang" in name:
        time.sleep(1000)
    if "killonce" in name:
        marker = Path(os.environ[LOG]).with_suffix(".killed")
        if marker.exists():
            return
        marker.touch()
    if "kill" in name:
        os.kill(os.getpid(), signal.SIGKILL)


def log(name):
    if LOG in os.environ:
        with open(os.environ[LOG], "a") as file:
            file.write(f"{name}\n")


def main(folder, out):
    """What a subprocess runs, to be killed."""
    identify_batch([folder], out, identify=identify)
