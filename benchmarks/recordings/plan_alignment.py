"""Whether pushes are paired with the right rows of a plan, or not at all.

A regular plan of 12 is recorded with any subset of its pushes missing and up to five
bumps between them that are no pushes. The times between pushes scatter by two percent;
the recording begins and ends up to two periods beside them. Printed are the shares
assigned right and refused; what is assigned wrong without a word must be none. `told`
is what is paired wrong in order, with humps named that are off the beat. Then the
same of regular plans with a pause of up to eight periods, whole or without one push,
and of whole plans by hand, for gaps that scatter by several shares, or with any number
of pauses. A pause of whole periods looks like missing pushes: some of those that lack
one are wrong. Last of nine directions with three pushes each, in a row or in three
runs, where a jump of the direction takes up to eight periods and scatters by up to
30 %, whole, without some pushes and with some bumps; which repeat a hump is does not
count.
"""

import argparse
from collections import Counter
from dataclasses import replace

import numpy as np

from pushfit.data.plans.alignment import Alignment, align
from pushfit.data.plans.schedule import PushSchedule

# Pushes of the plan.
N_PLANNED = 12
# Time between two pushes [s], and scatter of one in periods: of gaps it is 0.028.
PERIOD, SCATTER = 3.5, 0.02
# Bumps at most, and periods before the first push and after the last.
MAX_EXTRA, MAX_LEAD = 5, 2.0
# Periods by which a bump is off the beat of the pushes at least.
ON_BEAT = 0.25
# Periods that a pause lasts.
PAUSES = (0.5, 8.0)
# Periods that a jump takes, scatter of their logs at most, and of heights of repeats.
JUMPS, JUMP_SCATTER, REPEATS = (1.0, 8.0), 0.3, 0.03
# Pushes that are missing and bumps beside the others.
ODD = ((0, 0), (1, 0), (3, 0), (0, 1), (1, 1), (2, 2))
# Scatter of the gaps between pushes by hand.
BY_HAND = (0.1, 0.2, 0.3, 0.5)
# Shares of gaps in which a robot pauses.
OFTEN = (0.1, 0.3, 0.6)


def evenly(n: int, time: np.ndarray | None = None) -> PushSchedule:
    """A plan whose direction turns by one angle, and the times of its pushes [s]."""
    plan = PushSchedule.planned(np.radians(np.linspace(5.0, 85.0, n)), np.zeros(n))
    return replace(plan, time=time)


def case(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, tuple]:
    """Humps, the push of each (-1 for a bump), and the span of the recording."""
    there = rng.random(N_PLANNED) < rng.uniform(0.1, 1.0)
    times = PERIOD * (np.arange(N_PLANNED) + SCATTER * rng.standard_normal(N_PLANNED))
    lead, out = PERIOD * rng.uniform(0.2, MAX_LEAD, 2)
    span = (-lead, times[-1] + out)
    bumps = rng.uniform(*span, rng.integers(0, MAX_EXTRA + 1))
    # A bump on the beat is a push to anybody, whether one was made or not.
    off = np.abs(bumps / PERIOD - np.round(bumps / PERIOD))
    bumps = bumps[off > ON_BEAT]
    all_times = np.concatenate([times[there], bumps])
    push = np.concatenate([np.flatnonzero(there), np.full(len(bumps), -1)])
    order = np.argsort(all_times)
    return all_times[order], push[order], span


def verdict(
    found: Alignment, push: np.ndarray, direction: np.ndarray | None = None
) -> str:
    """`right`, `refused`, or `wrong`, by the direction that each hump is taken for."""
    if found.other is not None:
        return "refused"
    own = np.arange(len(found.hump)) if direction is None else direction
    there = found.hump >= 0
    taken = np.full(len(push), -1)
    taken[found.hump[there]] = own[there]
    is_right = np.array_equal(taken, np.where(push < 0, -1, own[push]))
    return "right" if is_right else "told" if found.off_beat else "wrong"


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
            plan=evenly(N_PLANNED),
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
            plan=evenly(N_PLANNED),
            span=(-PERIOD * lead, PERIOD * (beats[-1] + out)),
        )
        verdicts[verdict(found, push)] += 1
    return verdicts


def sweep(*, is_in_a_row: bool) -> PushSchedule:
    """Nine directions with three pushes each, in a row or in three runs."""
    theta = np.radians(np.arange(-60.0, 61.0, 15.0))
    if is_in_a_row:
        return PushSchedule.planned(theta, np.pi / 2, repeats=3)
    return PushSchedule.planned(np.tile(theta, 3), np.pi / 2, repeats=1)


def count_with_jumps(
    n_cases: int, *, is_in_a_row: bool, n_missing: int, n_bumps: int, seed: int = 0
) -> Counter[str]:
    """Verdicts of sweeps whose direction jumps, after every third push or run."""
    plan = sweep(is_in_a_row=is_in_a_row)
    n, direction = plan.n_pushes, plan.direction
    rng = np.random.default_rng(seed)
    verdicts: Counter[str] = Counter()
    for _ in range(n_cases):
        usual = np.exp(rng.uniform(*np.log(JUMPS)))
        jump = usual * np.exp(rng.uniform(0, JUMP_SCATTER) * rng.standard_normal(n))
        gaps = np.where(plan.is_jump, np.maximum(jump, 1.0), 1.0)[1:]
        beats = np.append(0.0, np.cumsum(gaps)) + SCATTER * rng.standard_normal(n)
        heights = rng.uniform(0.05, 1.0, n)[direction]
        heights = heights * np.exp(REPEATS * rng.standard_normal(n))
        lead, out = rng.uniform(0.2, MAX_LEAD, 2)
        bumps = rng.uniform(-lead, beats[-1] + out, n_bumps)
        off = np.abs(bumps[:, None] - beats).min(axis=1)
        bumps = bumps[np.abs(off - np.round(off)) > ON_BEAT]
        push = np.delete(np.arange(n), rng.choice(n, n_missing, replace=False))
        times = np.append(beats[push], bumps)
        order = np.argsort(times)
        found = align(
            PERIOD * times[order],
            [False] * len(times),
            plan=plan,
            span=(-PERIOD * lead, PERIOD * (beats[-1] + out)),
            heights=np.append(heights[push], rng.uniform(0.05, 1.0, len(bumps)))[order],
        )
        made = np.append(push, np.full(len(bumps), -1))[order]
        verdicts[verdict(found, made, direction)] += 1
    return verdicts


def count_whole(
    n_cases: int, scatter: float, pauses: float = 0.0, seed: int = 0
) -> Counter[str]:
    """Verdicts of whole plans, by the scatter of the logs of their gaps and pauses."""
    rng = np.random.default_rng(seed)
    verdicts: Counter[str] = Counter()
    for _ in range(n_cases):
        gaps = PERIOD * np.exp(scatter * rng.standard_normal(N_PLANNED - 1))
        if pauses:
            is_long = rng.random(N_PLANNED - 1) < pauses
            gaps += PERIOD * is_long * rng.uniform(*PAUSES, N_PLANNED - 1)
        times = np.append(0.0, np.cumsum(gaps))
        found = align(
            times,
            [False] * N_PLANNED,
            plan=evenly(N_PLANNED),
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
    found |= {f"by hand, {s:.0%}": count_whole(n_cases // 10, s) for s in BY_HAND}
    found |= {
        f"{share:.0%} of gaps pause": count_whole(n_cases // 10, SCATTER, share)
        for share in OFTEN
    }
    for is_in_a_row in (True, False):
        for n_missing, n_bumps in ODD:
            kind = "in a row" if is_in_a_row else "in runs"
            found[f"{kind}, {n_missing} missing, {n_bumps} more"] = count_with_jumps(
                n_cases // 10,
                is_in_a_row=is_in_a_row,
                n_missing=n_missing,
                n_bumps=n_bumps,
            )
    for plans, verdicts in found.items():
        for name, n in sorted(verdicts.items()):
            print(f"{plans:27} {name:8} {n:6d}  {n / verdicts.total():.1%}")


if __name__ == "__main__":
    main()
