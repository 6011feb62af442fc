"""Strategies of exploration beside each other: share decided, pushes, and coverage.

    python -m benchmarks.explore.by_engine --truths 1000 --controls 300
    python -m benchmarks.explore.by_engine --ask alpha_star --cap 36 --widths 60 20
    python -m benchmarks.explore.by_engine --ask both --widths 60 20
    python -m benchmarks.explore.by_engine --strategies gain --learned 100

Truths are draws of the default priors, and noise, which is stated, is 3 % of the median
height of the candidates. Beliefs are those of pushfit's engine, weighed and drawn anew
by the rules of `Explorer`; a decision is a shortest 90 % posterior interval of every
asked angle no wider than asked. With gain, forecasts are made as by `Explorer`, but
pushes go on after it would have given up: those that decide all the same say how often
that was wrong. Controls that must fail: noise believed 1.5 times too small, and
stopping on likelihood sets. With --learned also gain without a word on the noise, which
repeats and its prior are to tell: nothing is decided before the eighth push.

With --keep a run that was ended goes on, and prints what is known of all truths so far.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.explore.strategies import LIMITS, STRATEGIES, LikelihoodSets
from benchmarks.tables import CONFIG
from pushfit.explore.belief.belief import ASKABLE, Belief, Question
from pushfit.explore.belief.from_fit import believe
from pushfit.explore.belief.learning import learnt, weighed
from pushfit.explore.belief.predict import predict
from pushfit.explore.belief.tables import noise_is_known
from pushfit.explore.decide.next_push import Surveyor
from pushfit.explore.decide.stopping import (
    HOPELESS,
    IN_A_ROW,
    MIN_FORECAST,
    MIN_UNKNOWN_NOISE,
    Judge,
)
from pushfit.explore.explorer import KEPT_SHARE
from pushfit.explore.records import Answer, ToldPush
from pushfit.fit.programs.folder import enable_compile_cache

# Noise as a share of the median height, and what an interval holds.
NOISE, PROB = 0.03, 0.9
CHANNELS = {
    "height": ("height",),
    "components": ("height_normal", "height_tangential"),
}
# Noise believed too small by this, as a control.
TOO_SMALL = 0.67
# Truths between two prints of what there is.
BLOCK = 20
Stop = tuple[int, list[bool]] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Truths, and what is believed before the first push."""

    question: Question
    truths: Belief
    prior: Belief
    unstated: Belief
    surveyor: Surveyor

    @classmethod
    def of(cls, ask: str, channels: tuple[str, ...], seed: int) -> "World":
        """Truths and draws of the prior, from different seeds."""
        question = Question(
            config=CONFIG,
            ask=ASKABLE[ask],
            channels=channels,
            unit="n",
            sigma=1.0,
            reference_alpha=np.pi / 2,
        )
        return cls(
            question=question,
            truths=believe(None, question, 2 * seed + 1),
            prior=believe(None, question, 2 * seed),
            unstated=believe(None, replace(question, sigma=None), 2 * seed),
            surveyor=Surveyor(question, LIMITS),
        )


@dataclass(slots=True, kw_only=True)
class Course:
    """One truth explored by one strategy, as `Explorer` would believe it."""

    world: World
    number: int
    seed: int
    sigma: float
    question: Question
    belief: Belief
    told: list[ToldPush] = field(default_factory=list)
    n_drawn: int = 0

    @classmethod
    def of(
        cls, world: World, number: int, *, seed: int, factor: float | None
    ) -> "Course":
        """Before the first push; without a factor nothing is said of the noise."""
        theta, alpha = candidates(world)
        heights = predict(world.truths, theta, alpha).heights[:, :, number]
        size = np.linalg.norm(heights, axis=1)
        sigma = NOISE * float(np.median(size))
        belief, believed = world.unstated, None
        if factor is not None:
            believed = factor * sigma
            sd = np.full(len(world.question.channels), believed)
            belief = replace(world.prior, sd=sd)
        return cls(
            world=world,
            number=number,
            seed=seed,
            sigma=sigma,
            question=replace(world.question, sigma=believed),
            belief=belief,
        )

    def push(self, theta: float, alpha: float) -> None:
        """Push the truth and take in what is felt; noise belongs to the number."""
        n, own = len(self.told), self.world.truths
        found = predict(own, np.array([theta]), np.array([alpha])).heights[0]
        rng = np.random.default_rng([self.seed, self.number, n])
        felt = found[:, self.number] + self.sigma * rng.standard_normal(len(found))
        heights = dict(zip(own.channels, felt.tolist(), strict=True))
        self.told.append(ToldPush(theta=theta, alpha=alpha, heights=heights, sd=None))
        self.belief = weighed(self.belief, self.told[-1], self.question)
        if self.belief.is_guess or self.belief.effective_share < KEPT_SHARE:
            self.draw()

    def draw(self) -> None:
        """Fresh draws, unless they are."""
        if self.n_drawn < len(self.told):
            self.n_drawn = len(self.told)
            self.belief = learnt(
                self.told,
                self.question,
                n_drawn=self.n_drawn,
                source=believe,
                seed=self.seed + self.number,
            )

    def covered(self, judge: Judge) -> list[bool]:
        """Whether each angle is within its interval."""
        found = judge.intervals(self.belief, self.question)
        is_in = []
        for angle, interval in found.items():
            truth = float(self.world.truths.samples[angle][self.number])
            low, high = interval or (0.0, 0.0)
            past = truth - low
            past = np.mod(past, 180.0) if angle == "alpha_star" else past
            is_in.append(bool(0 <= past <= high - low))
        return is_in


def candidates(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Directions that may be pushed."""
    is_open = "alpha_star" in world.question.ask
    azimuths = LIMITS.azimuths(CONFIG) if is_open else None
    return tuple(LIMITS.candidates(azimuths=azimuths, reference_alpha=np.pi / 2).T)


def run(
    world: World,
    number: int,
    strategy: str,
    *,
    widths: Sequence[float],
    cap: int,
    seed: int,
    factor: float | None = 1.0,
    with_sets: bool = False,
) -> dict[str, object]:
    """Pushes until the smallest width is decided: where each width was, and answers."""
    course = Course.of(world, number, seed=seed, factor=factor)
    judges = [Judge(width=w, prob=PROB, budget=cap, seed=number) for w in widths]
    choose = STRATEGIES[strategy](world.question)
    rng = np.random.default_rng([seed, number, 10_000])
    stops: list[Stop] = [None] * len(widths)
    sets = LikelihoodSets(course.sigma, world.question.channels) if with_sets else None
    set_stops: list[Stop] = [None] * len(widths)
    chances: list[list] = []
    for n in range(cap):
        undecided = judges[-1].undecided(
            course.belief, judges[-1].intervals(course.belief, course.question)
        )
        theta, alpha = choose(course, undecided or world.question.ask, rng)
        course.push(theta, alpha)
        for i, judge in enumerate(judges):
            if stops[i] is None and is_decided(course, judge):
                course.draw()
                if is_decided(course, judge):
                    stops[i] = n + 1, course.covered(judge)
        if sets is not None:
            sets.add(theta, list(course.told[-1].heights.values()))
            low, high = sets.hull()
            truth = float(world.truths.samples["theta_c"][number])
            for i, width in enumerate(widths):
                if set_stops[i] is None and high - low <= width:
                    set_stops[i] = n + 1, [low <= truth <= high]
        if stops[-1] is not None and (sets is None or set_stops[-1] is not None):
            break
        # Without pushes left it is out of its budget, whatever the chances.
        if strategy == "gain" and factor == 1 and MIN_FORECAST <= n + 1 < cap:
            if stops[-1] is None:
                chances.append(forecast(course, judges[-1]))
    return {"stops": stops, "sets": set_stops if sets else [], "chances": chances}


def is_decided(course: Course, judge: Judge) -> bool:
    """Whether every interval is narrow enough, and the noise known well enough."""
    told, question = course.told, course.question
    found = judge.intervals(course.belief, question)
    is_known = noise_is_known(told, question) or len(told) >= MIN_UNKNOWN_NOISE
    return is_known and not judge.undecided(course.belief, found)


def forecast(course: Course, judge: Judge) -> list:
    """Pushes, chance to decide with those left, and with any number."""
    found = judge.intervals(course.belief, course.question)
    undecided = judge.undecided(course.belief, found)
    state = judge.state(
        course.belief,
        course.question,
        course.told,
        intervals=found,
        before=(),
        n_failed=0,
        limits=LIMITS,
        stopped=None,
        survey=lambda: course.world.surveyor.survey(course.belief, undecided=undecided),
    )
    return [len(course.told), state.p_budget, state.p_unlimited]


def describe(stops: Sequence[Stop], cap: int) -> str:
    """Share decided / median pushes / coverage at the stop, ± its standard error."""
    decided = [stop for stop in stops if stop is not None]
    if not decided:
        return "0.00/-/-"
    pushes = sorted(cap + 1 if stop is None else stop[0] for stop in stops)
    middle = pushes[len(pushes) // 2]
    inside = np.array([stop[1] for stop in decided], dtype=float)
    error = np.sqrt(PROB * (1 - PROB) / len(decided))
    cover = " ".join(f"{share:.3f}" for share in inside.mean(axis=0))
    shown = "-" if middle > cap else str(middle)
    return f"{len(decided) / len(stops):.2f}/{shown}/{cover} ± {error:.3f}"


def report(found: dict[str, list], widths: Sequence[float], cap: int) -> None:
    """One line for each strategy, and one for what was given up."""
    print("strategy".ljust(18), *(f"W <= {w:g}".rjust(28) for w in widths), "  truths")
    for label, results in found.items():
        if results and results[0]["stops"]:
            columns = [
                describe([r["stops"][i] for r in results], cap)
                for i in range(len(widths))
            ]
            cells = (column.rjust(28) for column in columns)
            print(label.ljust(18), *cells, f"{len(results):8d}", flush=True)
    results = [r for r in found.get("gain", []) if "chances" in r]
    for looks in (1, IN_A_ROW):
        given = [(answer_of(r["chances"], looks), r["stops"][-1]) for r in results]
        for word in (Answer.CANNOT, Answer.UNLIKELY):
            own = [stop for answer, stop in given if answer is word]
            wrong = sum(stop is not None for stop in own)
            share = wrong / max(len(own), 1)
            print(
                f"{looks} looks, {word.value}: {len(own)} of {len(results)}, of which "
                f"{wrong} decide ({share:.3f} of these)",
                flush=True,
            )


def answer_of(chances: list[list], looks: int) -> Answer | None:
    """How an exploration would have been given up."""
    for i in range(looks, len(chances) + 1):
        last = chances[i - looks : i]
        if all(within == 0 for _, within, _ in last):
            cannot = all((unlimited or 0) < HOPELESS for *_, unlimited in last)
            return Answer.CANNOT if cannot else Answer.UNLIKELY
    return None


def main() -> None:
    """Print the table, after every block of truths what is known so far."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--ask", choices=ASKABLE, default="theta_c")
    parser.add_argument("--channels", choices=CHANNELS, default="components")
    parser.add_argument("--truths", type=int, default=1000)
    parser.add_argument("--cap", type=int, default=40)
    parser.add_argument("--widths", type=float, nargs="+", default=[12.0, 6.0])
    parser.add_argument("--strategies", nargs="+", choices=STRATEGIES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--controls", type=int, default=0, metavar="TRUTHS")
    parser.add_argument("--learned", type=int, default=0, metavar="TRUTHS")
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--keep", type=Path, help="file that results are added to")
    args = parser.parse_args()
    enable_compile_cache()
    world = World.of(args.ask, CHANNELS[args.channels], args.seed)
    names = args.strategies or list(STRATEGIES)
    found: dict[str, list] = {name: [] for name in names}
    found |= {"sigma x 0.67": [], "likelihood sets": []} if args.controls else {}
    found |= {"sigma learned": []} if args.learned else {}
    start = time.monotonic()
    done = _kept(args.keep)
    usual = {"widths": args.widths, "cap": args.cap, "seed": args.seed}
    for number in range(args.truths):
        if (time.monotonic() - start) > 60 * args.minutes:
            break
        jobs: list[tuple[str, str, float | None]] = [(n, n, 1.0) for n in names]
        is_control = number < args.controls
        if is_control:
            jobs.append(("sigma x 0.67", "gain", TOO_SMALL))
        if number < args.learned:
            jobs.append(("sigma learned", "gain", None))
        for label, name, factor in jobs:
            key = f"{args.ask} {args.channels} {label} {number}"
            if key not in done:
                with_sets = is_control and label == "gain" and args.ask == "theta_c"
                done[key] = run(
                    world, number, name, factor=factor, with_sets=with_sets, **usual
                )
                _keep(args.keep, key, done[key])
            found[label].append(done[key])
            if label == "gain" and done[key]["sets"]:
                found["likelihood sets"].append(
                    {"stops": done[key]["sets"], "chances": []}
                )
        if (number + 1) % BLOCK == 0 or number + 1 == args.truths:
            took = time.monotonic() - start
            print(f"{args.ask}, {args.channels}, cap {args.cap}: {took:.0f} s")
            report(found, args.widths, args.cap)


def _kept(path: Path | None) -> dict[str, dict]:
    """Results of a run that was stopped."""
    if path is None or not path.exists():
        return {}
    return dict(json.loads(line) for line in path.read_text().splitlines())


def _keep(path: Path | None, key: str, result: dict) -> None:
    if path is not None:
        with path.open("a") as file:
            file.write(json.dumps([key, result]) + "\n")


if __name__ == "__main__":
    main()
