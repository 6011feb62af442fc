"""Write small logs in the forms that other programs leave them in.

The recordings in this folder are the output of this script, not measurements:
`rostopic.csv` and `plotjuggler.csv` are the azimuth sweep of the foam box in the counts
of a BioTac, `forces.csv` are the components of a force while the elevation goes from 10
to 80 degrees.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from pushfit.data.plans.schedule import PushSchedule, write_schedule
from pushfit.data.simulate import Session, simulate_recording
from pushfit.model import Grasp, Parameters

HERE = Path(__file__).parent
FOAM_BOX = HERE.parent / "foam_box"
SEED = 2025
KPA_PER_COUNT = 0.0365
IDLE_COUNTS = 2100
START_NS = 1_760_000_000_000_000_000
# Every second sample of the foam box is enough, and keeps the files small.
EVERY = 2
# A = 520 and B = 150 N/m: tan θ_c = 150 / (0.5 · 520), θ_c = 30.0°.
TRUTH = Parameters(K_sn=1300, K_dn=2600 / 3, K_st=450, C_rr=0.5, C_d=0.36, L=0.04)
ELEVATIONS = PushSchedule.planned(
    np.radians(np.arange(10.0, 81.0, 10.0)), np.zeros(8), repeats=3
)


def main(folder: Path = HERE) -> None:
    """Write the three logs and the schedule of the last one.

    Args:
        folder: Where to write.
    """
    sweep = pd.read_csv(FOAM_BOX / "alpha_sweep.csv").iloc[::EVERY]
    counts = (IDLE_COUNTS + sweep["pressure_kpa"] / KPA_PER_COUNT).round().astype(int)
    write_rostopic(folder / "rostopic.csv", sweep["time_s"].to_numpy(), counts)
    write_plotjuggler(folder / "plotjuggler.csv", sweep["time_s"].to_numpy(), counts)
    session = Session(rise=0.5, rest=0.6, rate=25.0, noise=0.01, unit="n", forces=True)
    recording = simulate_recording(
        TRUTH,
        Grasp(push_length=5e-3),
        ELEVATIONS,
        session=session,
        rng=np.random.default_rng(SEED),
    ).recording
    forces = {f"{name}_n": values for name, values in recording.channels.items()}
    frame = pd.DataFrame({"time_s": recording.time} | forces).round(3)
    frame.to_csv(folder / "forces.csv", index=False, lineterminator="\n")
    write_schedule(ELEVATIONS, folder / "forces_schedule.csv")


def write_rostopic(path: Path, time: np.ndarray, counts: pd.Series) -> None:
    """As `rostopic echo -p /biotac_pub` writes it, shortened to one channel."""
    stamps = START_NS + np.rint(time * 1e9).astype(int)
    frame = pd.DataFrame(
        {
            "%time": stamps + 700_000,
            "field.header.seq": np.arange(len(stamps)),
            "field.header.stamp": stamps,
            "field.bt_data0.pdc_data": counts.to_numpy(),
        }
    )
    frame.to_csv(path, index=False, lineterminator="\n")


def write_plotjuggler(path: Path, time: np.ndarray, counts: pd.Series) -> None:
    """As PlotJuggler exports two topics: one row for each sample of either."""
    fingers = pd.DataFrame({"__time": time, "/biotac/pdc": counts.to_numpy()})
    arm = pd.DataFrame({"__time": time[::5] + 0.013, "/arm/effort": 1.5})
    frame = pd.concat([fingers, arm]).sort_values("__time")
    frame["/biotac/pdc"] = frame["/biotac/pdc"].astype("Int64")
    frame["__time"] = (START_NS / 1e9 + frame["__time"]).map("{:.6f}".format)
    frame.to_csv(path, index=False, lineterminator="\n")


if __name__ == "__main__":
    main()
