"""Whether pushes are paired with the right rows of a plan, or not at all.

A regular plan of 12 is recorded with any subset of its pushes missing and up to five
bumps between them that are no pushes. The times between pushes scatter by two percent;
the recording begins and ends up to two periods beside them. Printed are the shares
assigned right and refused; what is assigned wrong without a word must be none. Then the
same of regular plans with a pause of up to eight periods, whole or without one push,
and of whole plans by hand, for gaps that scatter by several shares. A pause of whole
periods looks like missing pushes: some of those that lack one are wrong.
"""

import argparse
from collections import Counter

import numpy as np

from pushfit.data.plans.alignment import Alignment, align

# Pushes of the plan.
N_PLANNED = 12
# Time between two pushes [s], and scatter of one in periods: of gaps it is 0.028.
PERIOD, SCATTER = 3.5, 0.02
# Bumps at most, and periods before the first push and after the last.
MAX_EXTRA, MAX_LEAD = 5, 2.0
# Periods that a pause lasts.
PAUSES = (0.5, 8.0)
# Scatter of the gaps between pushes by hand.
BY_HAND = (0.1, 0.2, 0.3)


def case(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, tuple]:
    """Humps, the push of each (-1 for a bump), and the span of the recording."""
    there = rng.random(N_PLANNED) < rng.uniform(0.1, 1.0)
    times = PERIOD * (np.arange(N_PLANNED) + SCATTER * rng.standard_normal(N_PLANNED))
    lead, out = PERIOD * rng.uniform(0.2, MAX_LEAD, 2)
    span = (-lead, times[-1] + out)
    bumps = rng.uniform(*span, rng.integers(0, MAX_EXTRA + 1))
    # A bump on the beat is a push to anybody, whether one was made or not.
    off = np.abs(bumps / PERIOD - np.round(bumps / PERIOD))
    bumps = bumps[off > 0.25]
    all_times = np.concatenate([times[there], bumps])
    push = np.concatenate([np.flatnonzero(there), np.full(len(bumps), -1)])
    order = np.argsort(all_times)
    return all_times[order], push[order], span


def verdict(found: Alignment, push: np.ndarray) -> str:
    """`right`, `refused`, or `wrong`."""
    if found.other is not None:
        return "refused"
    right = np.full(N_PLANNED, -1)
    right[push[push >= 0]] = np.flatnonzero(push >= 0)
    return "right" if np.array_equal(found.hump, right) else "wrong"


def count(n_cases: int, seed: int = 0) -> Counter[str]:
    """Verdicts of simulated cases."""
    rng = np.random.default_rng(seed)
    verdicts: Counter[str] = Counter()
    for _ in range(n_cases):
        times, push, span = case(rng)
        if len(times) == 0:
            continue
        found = align(
            times,
            [False] * len(times),
            n_planned=N_PLANNED,
            planned_times=None,
            span=span,
        )
        verdicts[verdict(found, push)] += 1
    return verdicts


def count_with_pause(n_cases: int, n_missing: int, seed: int = 0) -> Counter[str]:
    """Verdicts of regular plans with a pause, some of their pushes missing."""
    rng = np.random.default_rng(seed)
    verdicts: Counter[str] = Counter()
    for _ in range(n_cases):
        beats = np.arange(N_PLANNED) + SCATTER * rng.standard_normal(N_PLANNED)
        beats[rng.integers(1, N_PLANNED) :] += rng.uniform(*PAUSES)
        lead, out = rng.uniform(0.2, MAX_LEAD, 2)
        missing = rng.choice(N_PLANNED, n_missing, replace=False)
        push = np.delete(np.arange(N_PLANNED), missing)
        found = align(
            PERIOD * beats[push],
            [False] * len(push),
            n_planned=N_PLANNED,
            planned_times=None,
            span=(-PERIOD * lead, PERIOD * (beats[-1] + out)),
        )
        verdicts[verdict(found, push)] += 1
    return verdicts


def count_by_hand(n_cases: int, scatter: float, seed: int = 0) -> Counter[str]:
    """Verdicts of whole plans, by the scatter of the logs of their gaps."""
    rng = np.random.default_rng(seed)
    verdicts: Counter[str] = Counter()
    for _ in range(n_cases):
        gaps = PERIOD * np.exp(scatter * rng.standard_normal(N_PLANNED - 1))
        times = np.append(0.0, np.cumsum(gaps))
        found = align(
            times,
            [False] * N_PLANNED,
            n_planned=N_PLANNED,
            planned_times=None,
            span=(-PERIOD, times[-1] + PERIOD),
        )
        verdicts[verdict(found, np.arange(N_PLANNED))] += 1
    return verdicts


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=10_000)
    n_cases = parser.parse_args().cases
    found = {"regular": count(n_cases)}
    found["with a pause"] = count_with_pause(n_cases // 10, 0)
    found["and one less"] = count_with_pause(n_cases // 10, 1)
    found |= {f"by hand, {s:.0%}": count_by_hand(n_cases // 10, s) for s in BY_HAND}
    for plans, verdicts in found.items():
        for name, n in sorted(verdicts.items()):
            print(f"{plans:14} {name:8} {n:6d}  {n / verdicts.total():.1%}")


if __name__ == "__main__":
    main()
