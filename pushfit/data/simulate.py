"""Tables and whole recordings of pushes whose truth is known.

Forces come from `pushfit.model.forward`; what is added here is what stands between a
force and a file: joints that reach whole degrees only, the shape of a push in time,
drift, sensor noise, counts and the end of the sensor's range. Excluded: randomness
other than by the generator that the caller passes.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

import equinox as eqx
import numpy as np
import pandas as pd
from jaxtyping import Float

from pushfit.arguments import checked
from pushfit.atomic import atomic_path
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.rules import CHANNELS
from pushfit.data.text.files import check_csv_name
from pushfit.data.units import in_degrees
from pushfit.errors import ConfigError
from pushfit.mechanics.ranges import (
    ABOVE_ZERO,
    LARGEST,
    Range,
    check_fields,
    check_numbers,
)
from pushfit.model import Channels, Grasp, Parameters, Pushes, forward
from pushfit.parameters import SensorUnit

# Components of a recorded force.
AXES = ("fx", "fy", "fz")
# The paper's two protocols (section 5): three pushes per direction.
THETA_SWEEP = PushSchedule.planned(
    np.radians(np.arange(-60.0, 61.0, 15.0)), np.radians(90.0), repeats=3
)
ALPHA_SWEEP = PushSchedule.planned(
    np.radians(15.0), np.radians(np.arange(0.0, 151.0, 30.0)), repeats=3
)
# One program for each number of pushes, where JAX would make twenty.
_forward = eqx.filter_jit(forward)


@checked
def simulate_table(
    params: Parameters,
    grasp: Grasp,
    *,
    theta: Float[np.ndarray, "*n"] | float,
    alpha: Float[np.ndarray, "*n"] | float,
    repeats: int,
    noise: float | Float[np.ndarray, " pushes"],
    rng: np.random.Generator,
    channels: tuple[str, ...] = ("height",),
    unit: str = "n",
    state_sd: bool = False,
) -> PeakTable:
    """Draw a table of peak heights from the model.

        height = forward(θ, α) + noise · N(0, 1)

    Args:
        params: True parameters.
        grasp: Grasp and sensor, as they truly are.
        theta: Elevations, broadcast against `alpha` [rad].
        alpha: Azimuths [rad].
        repeats: Pushes per direction, in a row.
        noise: Standard deviation of a height, one or per push [table unit].
        rng: Source of the noise.
        channels: Which of `height`, `height_normal`, `height_tangential` to give.
        unit: Unit that the sensor's `gain` gives.
        state_sd: Whether the table states `noise` as the sd of its heights.

    Returns:
        The table; pushes that lift the finger off are flagged `lost_contact`.

    Raises:
        ConfigError: Noise is negative, or of another number of pushes, or a channel is
            not known.

    Examples:
        >>> springs = {"K_sn": 600, "K_dn": 300, "K_st": 400}  # A = B = 200 N/m
        >>> table = simulate_table(
        ...     Parameters(**springs, C_rr=0.5, C_d=0.25, L=0.025),
        ...     Grasp(push_length=5e-3),
        ...     theta=np.radians([30.0, 90.0]),
        ...     alpha=0.0,
        ...     repeats=1,
        ...     noise=0.0,
        ...     rng=np.random.default_rng(0),
        ... )
        >>> table.heights("height").round(4).tolist()
        [0.559, 1.0]
    """
    plan = PushSchedule.planned(theta, alpha, repeats=repeats)
    rule = f"0 or above, and one number or one for each of the {plan.n_pushes} pushes"
    check_numbers("noise", noise, low=0.0, high=LARGEST, rule=rule)
    if np.shape(noise) not in ((), (plan.n_pushes,)):
        raise ConfigError(f"noise = {noise}: must be {rule}", code="noise")
    if unknown := set(channels) - set(CHANNELS):
        raise ConfigError(
            f"channels: {', '.join(sorted(unknown))} is not known; name some of "
            f"{', '.join(CHANNELS)}",
            code="channels",
        )
    truth = _forward(params, Pushes(theta=plan.theta, alpha=plan.alpha), grasp)
    heights = {
        name: np.asarray(getattr(truth, name))
        + noise * rng.standard_normal(plan.n_pushes)
        for name in channels
    }
    per_push = np.broadcast_to(noise, plan.n_pushes).astype(float)
    return PeakTable.from_arrays(
        theta=plan.theta,
        alpha=plan.alpha,
        heights=heights,
        unit=unit,
        sd=dict.fromkeys(channels, per_push) if state_sd else None,
        repeat=plan.repeat,
        flags=tuple("" if c else "lost_contact" for c in np.asarray(truth.in_contact)),
    )


PushShape = Literal["triangle", "sine", "plateau"]
# What fields of a session may be, words and numbers.
WORDS: dict[str, tuple[str, ...]] = {
    "shape": get_args(PushShape),
    "normal": (*AXES, *(f"-{axis}" for axis in AXES)),
    "unit": get_args(SensorUnit),
}
NUMBERS: tuple[Range, ...] = (
    (["rise", "rate", "quantum", "angle_resolution"], ABOVE_ZERO, LARGEST, "above 0"),
    (["hold", "rest", "jitter", "noise"], 0.0, LARGEST, "finite, 0 or above"),
    (["level", "drift"], -LARGEST, LARGEST, "a finite number"),
    (["step", "undershoot"], 0.0, 1.0, "from 0 to 1, a share of the height"),
    (["limit"], -LARGEST, math.inf, "a number, or None for no limit"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """How pushes are executed in time, and what the sensor makes of them.

    Args:
        shape: Course of a push: `triangle` (forth and back at constant speed),
            `sine` (half a period) or `plateau` (held at the end).
        rise: Time to the end of the push; the way back takes as long [s].
        hold: Time held at the end, for `plateau` [s].
        rest: Time between two pushes [s].
        rate: Samples per second [Hz].
        jitter: Standard deviation of a sampling step, relative to the step.
        level: Reading at rest [unit].
        drift: Change of the reading at rest [unit/s].
        noise: Standard deviation of a sample [unit].
        step: Share of the height reached at once on contact.
        undershoot: Share of the height by which the reading falls below rest on
            release, recovering within a second.
        limit: Largest reading of the sensor; None for no limit [unit].
        quantum: Resolution of the reading; None for continuous [unit].
        angle_resolution: Directions are reached within half of it, and recorded in
            multiples of it [rad].
        forces: Whether the three force components are recorded instead of a pressure.
        normal: Which of fx, fy and fz is along the contact normal, with "-" before it
            where pushing lowers it.
        channel: Name of the channel where no force components are recorded.
        unit: Unit of every channel.

    Raises:
        ConfigError: One of them is none that a session can have.
    """

    shape: PushShape = "triangle"
    rise: float = 1.0
    hold: float = 1.0
    rest: float = 1.5
    rate: float = 100.0
    jitter: float = 0.0
    level: float = 0.0
    drift: float = 0.0
    noise: float = 0.0
    step: float = 0.0
    undershoot: float = 0.0
    limit: float | None = None
    quantum: float | None = None
    angle_resolution: float = field(default=float(np.radians(1.0)))
    forces: bool = False
    normal: str = "fz"
    channel: str = "pressure"
    unit: str = "n"

    def __post_init__(self) -> None:
        """Refuse what no session is."""
        for name, known in WORDS.items():
            if (word := getattr(self, name)) not in known:
                raise ConfigError(
                    f"Session: {name} = {word!r}: must be one of {', '.join(known)}",
                    code="session",
                )
        check_fields(self, NUMBERS)

    @property
    def duration(self) -> float:
        """Time from contact to release [s]."""
        return 2 * self.rise + (self.hold if self.shape == "plateau" else 0.0)


# Time in which an undershoot falls to a third: of a BioTac's a twelfth is left after a
# second [s].
RECOVERY = 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRecording:
    """A recording with what is true of it.

    Args:
        recording: What a reader would give.
        schedule: Pushes as they were planned.
        theta: Elevation that each push really had [rad].
        alpha: Azimuth that each push really had [rad].
        truth: Heights of the pushes before noise and saturation [unit].
        t_start: Contact of each push [s].
        t_peak: Middle of each push [s].
    """

    recording: Recording
    schedule: PushSchedule
    theta: Float[np.ndarray, " n"]
    alpha: Float[np.ndarray, " n"]
    truth: Channels
    t_start: Float[np.ndarray, " n"]
    t_peak: Float[np.ndarray, " n"]


@checked
def simulate_recording(
    params: Parameters,
    grasp: Grasp,
    schedule: PushSchedule,
    *,
    session: Session,
    rng: np.random.Generator,
) -> SimulatedRecording:
    """Execute a schedule and record it.

    Args:
        params: True parameters.
        grasp: Grasp and sensor; its gain gives the unit of the session.
        schedule: Pushes to make.
        session: Their course in time, and the sensor.
        rng: Source of all randomness.

    Returns:
        The recording, with the angles of the joints as channels, and the truth.
    """
    n = schedule.n_pushes
    half = session.angle_resolution / 2
    theta = np.clip(schedule.theta + rng.uniform(-half, half, n), -np.pi / 2, np.pi / 2)
    alpha = schedule.alpha + rng.uniform(-half, half, n)
    truth = _forward(params, Pushes(theta=theta, alpha=alpha), grasp)
    period = session.duration + session.rest
    t_start = session.rest + period * np.arange(n)
    time = _clock(t_start[-1] + period, session, rng)
    # Which push a moment belongs to: the rest before a push is already its own.
    index = np.clip(((time - session.rest / 2) // period).astype(int), 0, n - 1)
    course = _course(time - t_start[index], session)
    recording = Recording(
        time=time,
        channels={
            name: sensed(time, course * amplitude[index], session=session, rng=rng)
            for name, amplitude in _amplitudes(truth, alpha, session).items()
        },
        units=dict.fromkeys(_amplitudes(truth, alpha, session), session.unit),
        theta=_to_resolution(theta, session)[index],
        alpha=_to_resolution(alpha, session)[index],
        notes=("simulated",),
    )
    return SimulatedRecording(
        recording=recording,
        schedule=schedule,
        theta=theta,
        alpha=alpha,
        truth=truth,
        t_start=t_start,
        t_peak=t_start + session.duration / 2,
    )


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as native CSV; the file is complete or absent."""
    check_csv_name(path)
    columns: dict[str, Float[np.ndarray, " n"]] = {"time_s": recording.time}
    for name, values in recording.channels.items():
        columns[f"{name}_{recording.units[name]}"] = values
    for name in ("theta", "alpha"):
        angle = getattr(recording, name)
        if angle is not None:
            columns[f"{name}_deg"] = in_degrees(angle)
    with atomic_path(path) as temporary:
        pd.DataFrame(columns).to_csv(temporary, index=False, lineterminator="\n")


def _clock(
    end: float, session: Session, rng: np.random.Generator
) -> Float[np.ndarray, " n"]:
    """Sample times, even or with random steps."""
    n = int(np.ceil(end * session.rate))
    steps = 1 + session.jitter * rng.standard_normal(n)
    # A step of a tenth is the shortest: time never stands still.
    return np.cumsum(np.maximum(steps, 0.1)) / session.rate


def _course(
    since: Float[np.ndarray, " n"], session: Session
) -> Float[np.ndarray, " n"]:
    """Share of the height, by the time since contact."""
    rise, duration = session.rise, session.duration
    distance = np.minimum(since, duration - since) / rise
    pushed = np.clip(distance, 0.0, 1.0)
    if session.shape == "sine":
        pushed = np.sin(np.pi / 2 * pushed)
    touching = (since >= 0) & (since <= duration)
    course = np.where(touching, session.step + (1 - session.step) * pushed, 0.0)
    released = np.maximum(since - duration, 0.0)
    recovery = session.undershoot * np.exp(-released / RECOVERY)
    return course - np.where(since > duration, recovery, 0.0)


def _amplitudes(
    truth: Channels, alpha: Float[np.ndarray, " n"], session: Session
) -> dict[str, Float[np.ndarray, " n"]]:
    """Change of each channel at the end of each push."""
    if not session.forces:
        return {session.channel: np.asarray(truth.height)}
    tangential = np.asarray(truth.height_tangential)
    name = session.normal.removeprefix("-")
    sign = -1.0 if session.normal.startswith("-") else 1.0
    first, second = (axis for axis in AXES if axis != name)
    changes = {
        first: tangential * np.cos(alpha),
        second: tangential * np.sin(alpha),
        name: sign * np.asarray(truth.height_normal),
    }
    return {axis: changes[axis] for axis in AXES}


def sensed(
    time: Float[np.ndarray, " n"],
    change: Float[np.ndarray, " n"],
    *,
    session: Session,
    rng: np.random.Generator,
) -> Float[np.ndarray, " n"]:
    """Reading of a sensor: level, drift, noise, range and resolution."""
    reading = session.level + session.drift * time + change
    reading = reading + session.noise * rng.standard_normal(len(time))
    if session.limit is not None:
        reading = np.minimum(reading, session.limit)
    if session.quantum is not None:
        reading = np.rint(reading / session.quantum) * session.quantum
    return reading


def _to_resolution(
    angle: Float[np.ndarray, " n"], session: Session
) -> Float[np.ndarray, " n"]:
    """Angle as the joints report it."""
    steps = np.rint(angle / session.angle_resolution)
    # Not -0.0, which would be printed.
    return steps * session.angle_resolution + 0.0
