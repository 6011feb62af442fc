"""Simulate both protocols of He & Zhang (2014) on a grasp like theirs.

The recordings in this folder are the output of this script, not measurements. The thumb
of a hand pushes a foam box 5 mm deep, three times in every direction: first for several
azimuths with the elevation going from -60 to 60 degrees, then at 15 degrees with the
azimuth going from 0 to 150. A fluid pressure in kPa is recorded, as a BioTac gives it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from pushfit.config import read_config
from pushfit.data.grasp import make_grasp
from pushfit.data.plans.schedule import PushSchedule, write_schedule
from pushfit.data.simulate import (
    ALPHA_SWEEP,
    Session,
    simulate_recording,
    write_recording,
)
from pushfit.data.truth import stated_parameters

HERE = Path(__file__).parent
SEED = 2014
# Quick pushes and a slow clock keep the files small.
SESSION = Session(
    shape="triangle",
    rise=0.5,
    rest=0.6,
    rate=50.0,
    level=12.0,
    drift=0.002,
    noise=0.05,
    unit="kpa",
)
# Joints that reach whole degrees only, and a sensor of 0.01 kPa.
DECIMALS = 2
THETA_SWEEP = PushSchedule.planned(
    np.radians(np.tile(np.arange(-60.0, 61.0, 15.0), 4)),
    np.radians(np.repeat([90.0, 60.0, 30.0, 0.0], 9)),
    repeats=3,
)


def main(folder: Path = HERE) -> None:
    """Write a recording and a schedule for each sweep.

    Args:
        folder: Where to write.
    """
    rng = np.random.default_rng(SEED)
    config = read_config(HERE / "truth.toml")
    params, grasp = stated_parameters(config), make_grasp(config, "kpa")
    for name, schedule in {"theta": THETA_SWEEP, "alpha": ALPHA_SWEEP}.items():
        simulated = simulate_recording(
            params, grasp, schedule, session=SESSION, rng=rng
        ).recording
        pressure = np.round(simulated.channels["pressure"], DECIMALS)
        recording = replace(
            simulated, channels={"pressure": pressure}, theta=None, alpha=None
        )
        write_recording(recording, folder / f"{name}_sweep.csv")
        write_schedule(schedule, folder / f"{name}_schedule.csv")


if __name__ == "__main__":
    main()
