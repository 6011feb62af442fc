"""How well peak extraction finds and measures pushes, beside what one might do instead.

For each shape of push and signal-to-noise ratio (height over the standard deviation of
a sample), 300 pushes are simulated on a drifting baseline. Printed are the share of
pushes found and of rows that are pushes, the bias of the heights in units of the noise
with its own standard error (biases of two versions that differ by less are the same),
their root mean square error in the same units, and the scatter of the heights over the
standard deviation that the table states. Then the bias of the largest sample over the
median before the push, and of SciPy's prominence. The last column is the share of
pushes flagged when the sensor ends at 80 % of the height.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import peak_prominences

from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.rows import rows_of
from pushfit.data.simulate import Session, SimulatedRecording, simulate_recording
from pushfit.model import Grasp, Parameters

# Biases are then known to 0.02 of the noise.
N_PUSHES = 300
SHAPES = ("triangle", "sine", "plateau")
# Heights over the noise of a sample.
RATIOS = (5, 10, 20, 50)
# Any grasp: all pushes are alike, and what counts is their shape.
PARAMS = Parameters(K_sn=800.0, K_dn=1500.0, K_st=400.0, C_rr=0.3, C_d=0.3, L=0.04)
GRASP = Grasp(push_length=5e-3)
PLAN = PushSchedule.planned(np.radians(45.0), np.radians(90.0), repeats=N_PUSHES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """What is printed for one shape and signal-to-noise ratio.

    Args:
        recall: Share of the pushes that are found.
        precision: Share of the rows that are pushes.
        bias: Mean error of the heights over the noise of a sample.
        bias_error: Standard error of `bias` from so many pushes.
        rms: Root mean square error of the heights over the noise of a sample.
        limit: Bias that is allowed: 0.1 of the noise and 0.2 % of the height.
        calibration: Root mean square error, bias removed, over the stated sd.
        bias_of_maximum: Bias of the largest sample over the rest before the push.
        bias_of_prominence: Bias of SciPy's prominence.
        flagged: Share of saturated pushes that are flagged.
    """

    recall: float
    precision: float
    bias: float
    bias_error: float
    rms: float
    limit: float
    calibration: float
    bias_of_maximum: float
    bias_of_prominence: float
    flagged: float


def simulate(
    shape: str, ratio: float, seed: int
) -> tuple[SimulatedRecording, float, Session]:
    """Record equal pushes; give the recording, their height and the session."""
    session = Session(shape=shape, angle_resolution=1e-9)
    rng = np.random.default_rng(seed)
    height = float(
        simulate_recording(
            PARAMS, GRASP, rows_of(PLAN, slice(1)), session=session, rng=rng
        ).truth.height[0]
    )
    period = session.duration + session.rest
    session = replace(
        session,
        noise=height / ratio,
        drift=0.02 * height / period,
        step=0.05,
        undershoot=0.01,
    )
    return (
        simulate_recording(PARAMS, GRASP, PLAN, session=session, rng=rng),
        height,
        session,
    )


def measure(shape: str, ratio: float, *, seed: int = 0) -> Accuracy:
    """Simulate, extract and compare with the truth."""
    made, height, session = simulate(shape, ratio, seed)
    table = extract_peaks(made.recording)
    found = match(made, table.frame["t_peak_s"].to_numpy(), session)
    rows = found[found >= 0]
    error = table.heights("height")[rows] - height
    noise = height / ratio
    maximum, prominence = alternatives(made, session)
    return Accuracy(
        recall=float(np.mean(found >= 0)),
        precision=len(rows) / table.n_pushes,
        bias=float(error.mean() / noise),
        bias_error=float(error.std() / len(error) ** 0.5 / noise),
        rms=float(np.sqrt(np.mean(error**2)) / noise),
        limit=0.1 + 0.002 * ratio,
        calibration=float(
            np.sqrt(error.var() / np.mean(table.sd("height")[rows] ** 2))
        ),
        bias_of_maximum=float((maximum - height).mean() / noise),
        bias_of_prominence=float((prominence - height).mean() / noise),
        flagged=saturated_share(shape, ratio, seed),
    )


def match(made: SimulatedRecording, times: np.ndarray, session: Session) -> np.ndarray:
    """Row of each push, -1 where none has its top within the push."""
    rows = np.full(N_PUSHES, -1)
    for row, time in enumerate(times):
        push = int(np.argmin(np.abs(made.t_peak - time)))
        if abs(made.t_peak[push] - time) < session.duration / 2:
            rows[push] = row
    return rows


def alternatives(
    made: SimulatedRecording, session: Session
) -> tuple[np.ndarray, np.ndarray]:
    """Heights by the largest sample and by prominence."""
    time, signal = made.recording.time, made.recording.channels["pressure"]
    maximum, prominence = np.empty(N_PUSHES), np.empty(N_PUSHES)
    for k, start in enumerate(made.t_start):
        first, last = np.searchsorted(time, [start, start + session.duration])
        before = np.searchsorted(time, start - session.rest / 2)
        after = np.searchsorted(time, start + session.duration + session.rest / 2)
        top = first + int(np.argmax(signal[first:last]))
        maximum[k] = signal[top] - np.median(signal[before:first])
        prominence[k] = peak_prominences(signal[before:after], [top - before])[0][0]
    return maximum, prominence


def saturated_share(shape: str, ratio: float, seed: int) -> float:
    """Share of pushes flagged where the sensor ends below their top."""
    made, height, session = simulate(shape, ratio, seed + 1)
    pressure = made.recording.channels["pressure"]
    # The end of the range moves with the drift, so that every push is cut alike.
    drift = session.drift * made.recording.time
    cut = np.minimum(pressure - drift, 0.8 * height)
    table = extract_peaks(replace(made.recording, channels={"pressure": cut}))
    rows = match(made, table.frame["t_peak_s"].to_numpy(), session)
    return float(np.mean([k >= 0 and "saturated" in table.flags[k] for k in rows]))


def main() -> None:
    """Print the table."""
    print(
        "shape     SNR  recall  precision    bias  ±error  (allowed)    rms  rms/sd  "
        "bias max  bias prominence  saturated"
    )
    for shape in SHAPES:
        for ratio in RATIOS:
            a = measure(shape, ratio)
            print(
                f"{shape:8} {ratio:4d} {a.recall:7.3f} {a.precision:10.3f} "
                f"{a.bias:+7.3f} {a.bias_error:7.3f} {a.limit:10.3f} {a.rms:6.3f} "
                f"{a.calibration:7.2f} {a.bias_of_maximum:+9.2f} "
                f"{a.bias_of_prominence:+16.2f} {a.flagged:10.2f}"
            )


if __name__ == "__main__":
    main()
