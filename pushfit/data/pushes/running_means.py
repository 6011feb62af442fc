"""Running means of unevenly sampled signals, as differences of an integral.

Counting samples would let a mean jump when its window moves past one of them. The
integral moves with the window, so nothing depends on where a recording begins.
Excluded: what is traced in them (`pushfit.data.pushes.tracing`).
"""

import functools
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pushfit.data.pushes.noise import SignalNoise, bends

# Shorter windows would divide rounding by next to nothing; no sensor is as fast [s].
_LEAST = 1e-12
# Samples that are integrated at once: 128 kB of each array stay in a processor's cache.
_SOME = 1 << 14
# Steps that the usual one is judged by, from the begin; more would only cost time.
_SAMPLES = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningMeans:
    """A signal by the integral of the straight lines between its samples.

    Args:
        time: Sample times, or some of them [s].
        integral: Of the signal less `level`, up to each of them.
        level: What the integral is over, so that little is lost to rounding.
        step: Median sampling step [s].
    """

    time: Float[np.ndarray, " n"]
    integral: Float[np.ndarray, " n"]
    level: float
    step: float

    @classmethod
    def of(
        cls,
        time: Float[np.ndarray, " n"],
        signal: Float[np.ndarray, " n"],
    ) -> "RunningMeans":
        """Course of samples at times [s]."""
        level, total = float(signal[0]), 0.0
        integral = np.zeros(len(time))
        # Some at a time, because recordings are longer than a processor's cache.
        for first in range(0, len(time) - 1, _SOME):
            part = slice(first, first + _SOME + 1)
            y, t = signal[part] - level, time[part]
            areas = (y[1:] + y[:-1]) * (0.5 * (t[1:] - t[:-1]))
            areas[0] += total
            up_to = np.cumsum(areas, out=integral[first + 1 :][: len(areas)])
            total = float(up_to[-1])
        step = float(np.median(np.diff(time[: 1 + _SAMPLES])))
        return cls(time=time, integral=integral, level=level, step=step)

    def thinned(self, stride: int) -> "RunningMeans":
        """The same, known at every `stride`-th of its times."""
        if stride == 1:
            return self
        time, integral = (
            np.append(all_[:-1:stride], all_[-1]) for all_ in (self.time, self.integral)
        )
        return replace(self, time=time, integral=integral)

    def smooth(
        self,
        when: Float[np.ndarray, "p m"],
        *,
        tau: Float[np.ndarray, "p 1"],
        ends: tuple[Float[np.ndarray, "#p 1"], Float[np.ndarray, "#p 1"]],
    ) -> Float[np.ndarray, "p m"]:
        """Running means; over what there is of their windows at the ends.

        Args:
            when: Times [s].
            tau: Averaging times [s].
            ends: Times that no window passes [s].
        """
        first = np.maximum(when - tau / 2, ends[0])
        return self.mean(first, np.minimum(when + tau / 2, ends[1]))

    def mean(
        self, first: Float[np.ndarray, "*m"], last: Float[np.ndarray, "*m"]
    ) -> Float[np.ndarray, "*m"]:
        """Means between pairs of times [s]."""
        area = self._up_to(last) - self._up_to(first)
        return self.level + area / np.maximum(last - first, _LEAST)

    def parts(self, edges: Float[np.ndarray, "p e"]) -> Float[np.ndarray, "p parts"]:
        """Means between successive times, in rows [s]."""
        areas = np.diff(self._up_to(edges), axis=1)
        return self.level + areas / np.maximum(np.diff(edges, axis=1), _LEAST)

    def _up_to(self, when: Float[np.ndarray, "*m"]) -> Float[np.ndarray, "*m"]:
        """Integral up to some times."""
        return np.interp(when, self.time, self.integral)


@dataclass(frozen=True, kw_only=True)
class View:
    """A signal, pushes going up, and how closely they are looked at in it.

    Args:
        time: Sample times [s].
        signal: Samples without gaps in value [unit].
        course: Running means of the samples [unit].
        noise: Scatter of the samples, and their resolution [unit].
        min_height: Smallest height of a push, lower humps are marked; None judges by
            the noise, and by the other pushes what is a brush [unit].
        smoothing: Averaging time; None takes a share of the width of each push [s].
        split: Two humps are two pushes if the valley between them is lower than this
            share of the lower hump.
    """

    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    course: RunningMeans
    noise: SignalNoise
    min_height: float | None
    smoothing: float | None
    split: float

    def between(self, begin: float, end: float) -> "View":
        """The samples between two times, as if there were no others."""
        part = slice(*np.searchsorted(self.time, [begin, end]))
        time, signal = self.time[part], self.signal[part]
        course = RunningMeans.of(time, signal) if len(time) > 1 else self.course
        return replace(self, time=time, signal=signal, course=course)

    @functools.cached_property
    def bends(self) -> tuple[RunningMeans, RunningMeans]:
        """Running means of the sizes of bends where the signal moves, and of where."""
        size, is_moving = bends(self.time, self.signal, self.noise.quantum)
        inner = self.time[1:-1]
        moving = is_moving.astype(float)
        return RunningMeans.of(inner, size * moving), RunningMeans.of(inner, moving)
