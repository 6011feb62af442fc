"""What an analysis does in turn, and how far it is by what each part usually takes.

Only the ratios of the times matter. Excluded: showing it (`pushfit.cli.progress`).
"""

import functools
from collections.abc import Callable, Sequence
from types import MappingProxyType

from pushfit.config import GraspConfig
from pushfit.mechanics.registry import mechanics_named

Progress = Callable[[str, float], None]
# Seconds of the example, with programs kept and with nothing compiled, as
# `python -m benchmarks.speed.stages` prints them; those of emcee, of a picture, and by
# tilting mechanics alone are guessed from an earlier machine's. Fit and posterior by
# other mechanics have begun beside the first ones.
SECONDS = MappingProxyType(
    {
        "least squares by linear mechanics": (6.7, 43.5),
        "least squares by tilting mechanics": (11.0, 105.0),
        "posterior by linear mechanics": (3.0, 50.1),
        "posterior by tilting mechanics": (4.0, 81.0),
        "fit and posterior by tilting mechanics": (3.9, 67.2),
        "likelihood sets by linear mechanics": (1.4, 1.3),
        "likelihood sets by tilting mechanics": (1.7, 1.8),
        "emcee": (90.0, 130.0),
        "checks": (0.7, 2.2),
        "next push": (0.5, 1.4),
        "report and figures": (17.5, 19.8),
        "picture": (6.0, 6.0),
    }
)


def stages_of(config: GraspConfig, engine: str) -> tuple[str, ...]:
    """What an identification does, in turn."""
    words = [f"by {one.grasp.mechanics} mechanics" for one in config.by_mechanics()]
    names = [f"least squares {words[0]}"]
    if len(words) > 1:
        names += [
            f"posterior {words[0]}",
            *(f"fit and posterior {by}" for by in words[1:]),
        ]
    names.append(f"likelihood sets {words[-1]}")
    if engine == "emcee":
        names.append("emcee")
    elif len(words) == 1:
        names.append(f"posterior {words[0]}")
    return (*names, "checks")


def posterior_stage(config: GraspConfig) -> str:
    """What draws by the mechanics of settings are called, which leave none open."""
    return f"posterior by {config.grasp.mechanics} mechanics"


def usual_seconds(stages: Sequence[str], *, is_compiled: bool = True) -> float:
    """Time that stages usually take together [s].

    Args:
        is_compiled: Whether programs are kept.
    """
    return sum((_seconds(name)[not is_compiled] for name in stages), 0.0)


def _seconds(stage: str) -> tuple[float, float]:
    """Time of a stage, with programs kept and with none [s]."""
    what, _, by = stage.partition(" by ")
    if by and stage not in SECONDS:
        is_searched = mechanics_named(by.removesuffix(" mechanics")).is_searched
        stage = f"{what} by {'tilting' if is_searched else 'linear'} mechanics"
    return SECONDS[stage]


class Stages:
    """Tells how far a run is by what its stages usually take.

    Args:
        names: What is done, in turn.
        told: Called with a stage and the share of the run that is done.
        is_compiled: Whether programs are kept.
    """

    def __init__(
        self,
        names: Sequence[str],
        told: Progress | None = None,
        *,
        is_compiled: bool = True,
    ) -> None:
        """Begin before the first stage."""
        self._names, self._told = list(names), told
        self._usual = functools.partial(usual_seconds, is_compiled=is_compiled)
        self._done, self._now = 0.0, ""

    def begin(self, name: str) -> None:
        """Say that the stage before is over, and this one begins."""
        what = name.split(" by ")[0]
        if name not in self._names:  # by the other mechanics than foreseen
            alike = [n for n in self._names if n.split(" by ")[0] == what]
            self._names = [name if n in alike[-1:] else n for n in self._names]
        if name in self._names:
            before = self._usual(self._names[: self._names.index(name)])
            # What was not foreseen may come late; a bar never goes back.
            self._done, self._now = max(before, self._done), name
        self.within(name, 0.0)

    def within(self, stage: str, share: float) -> None:
        """Say which share of the stage that began last is done."""
        if self._told is not None:
            done = self._done + share * self._usual([self._now] if self._now else [])
            self._told(stage, min(1.0, done / self._usual(self._names)))
