"""A hand that is not there: push model and simulated sensor.

Time is the hand's own and passes without waiting. Excluded: a simulated robot for ROS
(`pushfit.explore.hands.ros.robot`).
"""

from dataclasses import dataclass, replace

import equinox as eqx
import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.grasp import make_grasp
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.data.simulate import AXES, Session, sensed, simulate_recording
from pushfit.data.truth import stated_parameters
from pushfit.errors import ConfigError
from pushfit.explore.belief.predict import force_of
from pushfit.explore.hands.protocol import PushOutcome, PushStatus, Reach
from pushfit.model import Grasp, Parameters

# A push goes in and out in a second in all, and rests before the next one.
SESSION = Session(shape="triangle", rise=0.5, rest=0.6, rate=100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """What is true and nobody knows.

    Args:
        params: Stiffnesses and friction of finger and object.
        grasp: Grasp and sensor.
        session: How pushes are executed and sensed.
        reach: Where the finger can push.
        scatter: Standard deviation of the height of a push, relative to it: how it is
            executed, which no sensor noise shows.
    """

    params: Parameters
    grasp: Grasp
    session: Session
    reach: Reach
    scatter: float = 0.0


class SimulatedHand:
    """A hand for tests, demonstrations and rehearsals.

    Args:
        seed: Seed of all randomness; push n of a seed is always the same.
    """

    def __init__(self, world: World, *, seed: int) -> None:
        """Begin at rest."""
        self.world, self.seed = world, seed
        self.clock, self.n_pushes = 0.0, 0
        self.is_extended = False
        self._parts: list[Recording] = []

    def push(
        self, displacement: Float[np.ndarray, "3"], *, max_force: float | None
    ) -> PushOutcome:
        """Push and record; see `Hand`."""
        self.n_pushes += 1
        rng = np.random.default_rng([self.seed, self.n_pushes])
        length = float(np.linalg.norm(displacement))
        theta = float(np.arcsin(np.clip(displacement[2] / length, -1, 1)))
        alpha = float(np.arctan2(displacement[1], displacement[0]))
        share, status = 1.0, PushStatus.DONE
        params, grasp = self.world.params, self._grasp(length)
        force = force_of(params, grasp, theta=theta, alpha=alpha)
        if max_force is not None and force > max_force:
            share, status = max_force / force, PushStatus.FORCE_ABORT
        part, t_start, t_end = self._record(
            theta, alpha, length=share * length, rng=rng
        )
        self.is_extended = True
        self._parts.append(part)
        return PushOutcome(
            status=status, reached=share * displacement, t_start=t_start, t_end=t_end
        )

    def pass_by(self, n: int, *, rest: float) -> None:
        """Be where a hand is that has made pushes, as `explore` makes them.

        Args:
            n: How many.
            rest: Rest before each and after it [s].
        """
        for _ in range(n):
            self.rest(rest)
            self.push(np.array([0.0, 0.0, 1e-3]), max_force=None)
            self.rest(rest)
        self.retract()

    def retract(self) -> None:
        """Return to the contact."""
        self.is_extended = False

    def stop(self) -> None:
        """Nothing moves while nobody pushes."""

    def rest(self, seconds: float) -> None:
        """Let the sensor rest; no time of its clock passes while somebody thinks."""
        rng = np.random.default_rng([self.seed, self.n_pushes, 1])
        rate = self.world.session.rate
        n = max(int(np.ceil(seconds * rate)), 1)
        channels = self._nothing(n, rng)
        part = Recording(
            time=np.arange(1, n + 1) / rate + self.clock,
            channels=channels,
            units=dict.fromkeys(channels, self.world.session.unit),
            theta=np.full(n, np.nan),
            alpha=np.full(n, np.nan),
        )
        self.clock = float(part.time[-1])
        self._parts.append(part)

    def samples(self, since: float) -> Recording:
        """All samples since a moment, in the order in which they came."""
        parts = self._parts
        joined = replace(
            parts[-1],
            time=np.concatenate([p.time for p in parts]),
            channels={
                name: np.concatenate([p.channels[name] for p in parts])
                for name in parts[-1].channels
            },
            **{
                angle: np.concatenate([getattr(p, angle) for p in parts])
                for angle in ("theta", "alpha")
            },
        )
        recent = joined.time >= since
        # A clock that went back leaves samples of the push before the moment.
        first = int(np.argmax(recent)) if np.any(recent) else recent.size
        return joined.taken(np.arange(first, recent.size))

    def reach(self) -> Reach:
        """Where the finger can push."""
        return self.world.reach

    def _grasp(self, length: float) -> Grasp:
        return eqx.tree_at(lambda g: g.push_length, self.world.grasp, length)

    def _session(self) -> Session:
        """The session from now on: drift goes on where it was."""
        session = self.world.session
        return replace(session, level=session.level + session.drift * self.clock)

    def _record(
        self, theta: float, alpha: float, *, length: float, rng: np.random.Generator
    ) -> tuple[Recording, float, float]:
        """One push on the clock, and when it began and ended."""
        grasp = self._grasp(length)
        scatter = 1 + self.world.scatter * rng.standard_normal()
        grasp = eqx.tree_at(lambda g: g.gain, grasp, grasp.gain * scatter)
        plan = PushSchedule.planned(theta, alpha, repeats=1)
        found = simulate_recording(
            self.world.params, grasp, plan, session=self._session(), rng=rng
        )
        part = replace(found.recording, time=found.recording.time + self.clock)
        t_start = self.clock + float(found.t_start[0])
        self.clock = float(part.time[-1])
        return part, t_start, t_start + self.world.session.duration

    def _nothing(
        self, n: int, rng: np.random.Generator
    ) -> dict[str, Float[np.ndarray, " n"]]:
        """What is felt while nobody pushes."""
        session = self._session()
        time = np.arange(1, n + 1) / session.rate
        reading = sensed(time, np.zeros(n), session=session, rng=rng)
        names = AXES if session.forces else (session.channel,)
        return {name: reading.copy() for name in names}


def joints_stated(config: GraspConfig) -> GraspConfig:
    """Settings that say how far the joints of this hand miss, unless they do already.

        sd = w / √12

    An angle is anywhere within half a step w of what the joints report.
    """
    sd = float(np.degrees(SESSION.angle_resolution) / np.sqrt(12))
    names = ("theta_sd_deg", "alpha_sd_deg")
    missing = {name: sd for name in names if getattr(config.noise, name) is None}
    return config.with_keys("noise", **missing)


def check_normal(normal: str) -> None:
    """Refuse a name of the normal component that this hand has no reading of."""
    if normal.removeprefix("-") not in AXES:
        raise ConfigError(
            f"[peaks] normal = {normal!r} is no channel of the simulated sensor, which "
            f"has {', '.join(AXES)}; name one of these to explore with it",
            code="no_channel",
        )


def simulated_hand(
    config: GraspConfig,
    *,
    theta_deg: tuple[float, float],
    unit: str,
    noise: float,
    scatter: float,
    forces: bool,
    seed: int,
    normal: str = "fz",
) -> SimulatedHand:
    """A hand that holds the grasp of a configuration.

    Args:
        noise: Standard deviation of a sample [unit].
        scatter: Standard deviation of the height of a push, relative to it.
        normal: Of force components, the one along the contact normal, see `Session`.

    Raises:
        ConfigError: A parameter is missing, or the preload is no number.
    """
    preload = config.preload_in(unit)
    if isinstance(preload, str):
        raise ConfigError(
            f"the preload is {preload!r}; a simulated hand needs a number for "
            f"[grasp] preload_{unit}",
            code="no_truth",
        )
    session = replace(
        SESSION, unit=unit, noise=noise, level=preload, forces=forces, normal=normal
    )
    world = World(
        params=stated_parameters(config),
        grasp=make_grasp(config, unit),
        session=session,
        reach=Reach(theta_deg=theta_deg, alpha_deg=config.reach.alpha_deg),
        scatter=scatter,
    )
    return SimulatedHand(world, seed=seed)
