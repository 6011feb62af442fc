"""What an analysis does in turn, and how far it is by what each part usually takes.

Only the ratios of the times matter, and they hold within a factor of two on other
machines, for other tables, and while programs are compiled.
"""

from collections.abc import Callable, Sequence
from types import MappingProxyType

from pushfit.config import GraspConfig

Progress = Callable[[str, float], None]
# Seconds of warm runs of the example, and of one by emcee, as `python -m
# benchmarks.stages` prints them.
SECONDS = MappingProxyType(
    {
        "least squares by linear mechanics": 2.0,
        "least squares by tilting mechanics": 4.0,
        "set of θ_c by linear mechanics": 0.4,
        "set of θ_c by tilting mechanics": 2.3,
        "posterior by linear mechanics": 2.2,
        "posterior by tilting mechanics": 4.2,
        "likelihood sets by linear mechanics": 2.0,
        "likelihood sets by tilting mechanics": 17.0,
        "emcee": 60.0,
        "checks": 0.5,
        "next push": 3.0,
        "report and figures": 8.0,
    }
)


def stages_of(config: GraspConfig, engine: str) -> tuple[str, ...]:
    """What an identification does, in turn.

    Args:
        config: Configuration in force.
        engine: As in `identify_table`.
    """
    words = [f"by {one.grasp.mechanics} mechanics" for one in config.by_mechanics()]
    names = [f"least squares {by}" for by in words]
    if len(words) > 1:
        names += [
            f"{what} {by}" for by in words for what in ("set of θ_c", "posterior")
        ]
    names.append(f"likelihood sets {words[-1]}")
    if engine == "emcee":
        names.append("emcee")
    elif len(words) == 1:
        names.append(f"posterior {words[0]}")
    return (*names, "checks")


def usual_seconds(stages: Sequence[str]) -> float:
    """Time that stages usually take together [s]."""
    return sum((SECONDS[name] for name in stages), 0.0)


class Stages:
    """Tells how far a run is by what its stages usually take.

    Args:
        names: What is done, in turn.
        told: Called with a stage and the share of the run that is done.
    """

    def __init__(self, names: Sequence[str], told: Progress | None = None) -> None:
        """Begin before the first stage."""
        self._names, self._told = list(names), told
        self._done, self._now = 0.0, ""

    def begin(self, name: str) -> None:
        """Say that the stage before is over, and this one begins."""
        what = name.split(" by ")[0]
        if name not in self._names:  # by the other mechanics than foreseen
            alike = [n for n in self._names if n.split(" by ")[0] == what]
            self._names = [name if n in alike[-1:] else n for n in self._names]
        if name in self._names:
            before = usual_seconds(self._names[: self._names.index(name)])
            # What was not foreseen may come late; a bar never goes back.
            self._done, self._now = max(before, self._done), name
        self.within(name, 0.0)

    def within(self, stage: str, share: float) -> None:
        """Say that so much of the stage that began last is done.

        Args:
            stage: What to call it.
            share: Share of it.
        """
        if self._told is not None:
            done = self._done + share * SECONDS.get(self._now, 0.0)
            self._told(stage, min(1.0, done / usual_seconds(self._names)))
