"""A simulated hand with what can go wrong: object, finger and sensor.

Faults are asked for by the number of the push that has them.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import equinox as eqx
import numpy as np

from pushfit.data.recordings.records import Recording
from pushfit.explore.hands.simulated import SimulatedHand, World

# Share of a push after which it stalls, and of the stiffness that a slip leaves.
STALLS_AT, SLIP = 0.4, 0.5


def dropout(part: Recording, t_start: float, t_end: float) -> Recording:
    """No samples after the middle of the push until its end."""
    middle = (t_start + t_end) / 2
    lost = (part.time > middle - 0.1) & (part.time < t_end + 0.2)
    return part.taken(np.flatnonzero(~lost))


def frozen(part: Recording, t_start: float, t_end: float) -> Recording:
    """The reading of the middle of the push, for ever."""
    stuck = part.time > (t_start + t_end) / 2 - 0.2
    first = int(np.argmax(stuck))
    channels = {
        name: np.where(stuck, values[first], values)
        for name, values in part.channels.items()
    }
    return replace(part, channels=channels)


def lost(part: Recording, t_start: float, t_end: float) -> Recording:
    """Nothing to be felt from the middle of the push on."""
    gone = part.time > (t_start + t_end) / 2
    channels = {
        name: np.where(gone, 0.0, values) for name, values in part.channels.items()
    }
    return replace(part, channels=channels)


def duplicate(part: Recording, t_start: float, t_end: float) -> Recording:
    """Every tenth message twice."""
    return part.taken(np.sort(np.r_[0 : part.time.size, 0 : part.time.size : 10]))


def late(part: Recording, t_start: float, t_end: float) -> Recording:
    """Every twentieth message three places too late."""
    rows = np.arange(part.time.size, dtype=float)
    rows[::20] += 3.5
    return part.taken(np.argsort(rows, kind="stable"))


def ahead(part: Recording, t_start: float, t_end: float) -> Recording:
    """The clock of the sensor leaps an hour in the middle of the push."""
    middle = (t_start + t_end) / 2
    return replace(part, time=np.where(part.time > middle, part.time + 3600, part.time))


def back(part: Recording, t_start: float, t_end: float) -> Recording:
    """The clock of the sensor goes back by more than a push."""
    middle = (t_start + t_end) / 2
    return replace(part, time=np.where(part.time > middle, part.time - 3, part.time))


def silent(part: Recording, t_start: float, t_end: float) -> Recording:
    """The sensor says nothing from before the push on."""
    return part.taken(np.flatnonzero(part.time < t_start - 0.1))


SPOILS: Mapping[str, Callable[[Recording, float, float], Recording]] = {
    "dropout": dropout,
    "frozen": frozen,
    "object_lost": lost,
    "duplicate": duplicate,
    "late": late,
    "clock_jump": ahead,
    "clock_back": back,
    "silent": silent,
}
FAULTS = {*SPOILS, "stall", "slip", "object_gone"}


class FaultyHand(SimulatedHand):
    """What goes wrong, by the number of the push, from 1.

    Samples are stamped by `delay` later than the motion [s].
    """

    def __init__(
        self, world: World, *, seed: int, faults: Mapping[int, str], delay: float
    ) -> None:
        super().__init__(world, seed=seed)
        assert FAULTS.issuperset(faults.values())
        self.faults, self.delay, self.has_object = faults, delay, True

    def push(self, displacement, *, max_force):
        is_stalled = self.faults.get(self.n_pushes + 1) == "stall"
        share = STALLS_AT if is_stalled else 1.0
        return super().push(share * displacement, max_force=max_force)

    def samples(self, since):
        found = super().samples(since - self.delay)
        return replace(found, time=found.time + self.delay)

    def _record(self, theta, alpha, *, length, rng):
        fault = self.faults.get(self.n_pushes, "")
        if fault == "slip":
            params = self.world.params
            softer = eqx.tree_at(lambda p: p.K_dn, params, SLIP * params.K_dn)
            self.world = replace(self.world, params=softer)
        if fault == "object_gone":
            self.has_object = False
        part, t_start, t_end = super()._record(theta, alpha, length=length, rng=rng)
        if not self.has_object:
            part = replace(part, channels=self._nothing(part.time.size, rng))
        if fault == "object_lost":
            self.has_object = False
        if fault in SPOILS:
            part = SPOILS[fault](part, t_start, t_end)
        return part, t_start, t_end

    def _session(self):
        """Without an object, without its preload."""
        session = super()._session()
        return session if self.has_object else replace(session, level=0.0)
