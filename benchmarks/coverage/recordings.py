"""How often intervals of θ_c hold the truth where all begins with a recording.

    python -m benchmarks.coverage.recordings [--shape plateau] [--tables 300] [--seed 0]

Truths, pushes and counts are those of `benchmarks.coverage.one_sweep`. Here each grasp
is recorded as a force that drifts, and its pushes are found, measured and paired with
their schedule before they are identified: heights and their standard deviations are
what the recording shows. `--noise` is that of a sample, a share of the tallest height
of one firm grasp, `--rest` the time between two pushes in seconds, `--undershoot` what
the sensor falls by on release, a share of each height. What is refused counts as a
table without a result, and the reasons are printed, as is how the heights scatter by
their own standard deviations.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from typing import get_args, get_type_hints

import numpy as np

from benchmarks.coverage.one_sweep import (
    QUANTITIES,
    REPEATS,
    TALLEST,
    THETA,
    Answers,
    answers,
    pushes,
    summary,
)
from benchmarks.tables import CONFIG, GRASP, NAMES
from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.simulate import Session, simulate_recording
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.coverage import simulate_tables
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.results import FitStatus
from pushfit.model import Parameters

CHANNEL, UNIT = "force", "n"
SCHEDULE = PushSchedule.planned(THETA, np.zeros_like(THETA), repeats=REPEATS)
# Pushes of a second, plateaus of more, read at 100 Hz over a level that drifts by about
# a thousandth of the tallest height in a second.
RISE, HOLD, RATE, DRIFT = 0.5, 0.6, 100.0, 0.001
# So that joints are where the schedule says [rad].
EXACT = 1e-6
SHAPES = get_args(get_type_hints(Session)["shape"])
# Of the tallest height; and a rest that shows how the level drifts [s].
NOISE, REST = 0.01, 3.0


def recorded(
    params: Parameters, session: Session, rng: np.random.Generator
) -> tuple[PeakTable, np.ndarray]:
    """Heights as measured in a recording, and how far those in use are off [sd]."""
    made = simulate_recording(params, GRASP, SCHEDULE, session=session, rng=rng)
    settings = PeakSettings(channel=CHANNEL)
    table = extract_peaks(made.recording, SCHEDULE, settings=settings)
    sd = table.sd("height")
    assert sd is not None
    off = (table.heights("height") - np.asarray(made.truth.height)) / sd
    return table, off[table.is_used]


def run(
    options: argparse.Namespace, refused: Counter[str], pulls: list[np.ndarray]
) -> Iterator[tuple[float, Answers | None]]:
    """True θ_c and answers of recording after recording; None where there is none."""
    rng = np.random.default_rng(options.seed)
    truths = simulate_tables(pushes(), options.tables, rng).truths
    for index in range(options.tables):
        truth = {name: float(truths[name][index]) for name in (*QUANTITIES, *NAMES)}
        session = Session(
            shape=options.shape,
            rise=RISE,
            hold=HOLD,
            rest=options.rest,
            rate=RATE,
            drift=DRIFT * TALLEST * rng.standard_normal(),
            noise=options.noise * TALLEST,
            undershoot=options.undershoot,
            angle_resolution=EXACT,
            channel=CHANNEL,
            unit=UNIT,
        )
        params = Parameters(**{name: truth[name] for name in NAMES})
        held = None
        try:
            table, pull = recorded(params, session, rng)
            pulls.append(pull)
            found = identify_table(
                table, CONFIG, seed=index, engine="sweep", is_brief=True
            )
        except PushfitError as error:
            refused[error.code] += 1
        else:
            held = answers(found, truth) if found.status is FitStatus.OK else None
        yield truth["theta_c"], held


def main() -> None:
    """Print the coverage of every quantity."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shape", choices=SHAPES, default="plateau")
    parser.add_argument("--tables", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, default=NOISE)
    parser.add_argument("--rest", type=float, default=REST)
    parser.add_argument("--undershoot", type=float, default=0.0)
    options = parser.parse_args()
    refused: Counter[str] = Counter()
    pulls: list[np.ndarray] = []
    print(summary(list(run(options, refused, pulls))))
    print("refused:", ", ".join(f"{n} {code}" for code, n in refused.items()) or "none")
    off = np.concatenate(pulls)
    mean, scatter = np.mean(off), np.std(off)
    print(f"heights off by {mean:+.2f} of their sd, and scatter by {scatter:.2f} of it")


if __name__ == "__main__":
    main()
