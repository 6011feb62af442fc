"""Strategies of exploration beside each other: share decided, pushes, and coverage.

    python -m benchmarks.explore.answers --channels components --truths 1000
    python -m benchmarks.explore.answers --channels height --cap 60 --widths 30 12 6
    python -m benchmarks.explore.answers --explorer 100

Truths are drawn from the default priors, as normals in the logs; noise is 3 % of the
median height. A decision is a shortest 90 % posterior interval of θ_c no wider than
asked. The posterior is a grid of its own over θ_c and ln C_rr with ln A by Laplace, so
that the rule is judged apart from the engine; gains and intervals are pushfit's. With
--control, rows that must lose coverage: noise believed 1.5 times too small, and
stopping on likelihood sets, with pushes chosen by gain and with pushes in passes; of
the latter also the coverage after fixed numbers of pushes, which must not be lost. With
--explorer, `pushfit.Explorer` itself runs on draws from that grid, with its forecasts.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.explore.strategies import LikelihoodSets
from benchmarks.tables import CONFIG
from pushfit.explore.belief.belief import N_BELIEF_DRAWS, Belief
from pushfit.explore.decide.gain import information_gain
from pushfit.explore.decide.intervals import AskedAngle, shortest_interval
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits
from pushfit.explore.records import Answer
from pushfit.model import Grasp
from pushfit.parameters import TINY

# The paper's [m].
LENGTH = 5e-3
# Elevations that may be pushed at [rad].
THETA = np.radians(np.arange(5.0, 90.0, 5.0))
# Noise as a share of the median height, and what an interval holds.
NOISE, PROB = 0.03, 0.9
# Draws behind a gain here: a quarter of what pushfit takes, for a thousand truths.
N_GAIN = 2048
# Cells of a quarter of a degree of θ_c, and nodes of ln C_rr.
N_THETA_C, N_C = 360, 48
# Label of a control: stopping on likelihood sets.
BY_SETS = "likelihood sets"
# Numbers of pushes after which such sets are looked at whatever their width.
FIXED = (3, 6, 12, 24, 40)
COMPONENTS = ("height_normal", "height_tangential")
CHANNELS = {"height": ("height",), "components": COMPONENTS}


@dataclass(frozen=True)
class LogPrior:
    """Means and standard deviations of ln A, ln B and ln C_rr."""

    mean: np.ndarray
    sd: np.ndarray


def log_prior() -> LogPrior:
    """Normals in the logs with the moments of the default priors."""
    rng = np.random.default_rng(0)
    n = 400_000
    K_sn, K_dn, K_st, C_d = (
        m * np.exp(0.8 * rng.standard_normal(n)) for m in (800, 2000, 400, 0.5)
    )
    L = 0.04 * np.exp(0.3 * rng.standard_normal(n))
    A, B = K_sn * K_dn / (K_sn + K_dn), K_st * C_d / (L**2 * K_st + C_d)
    logs = np.log([A, B])
    return LogPrior(
        mean=np.array([*logs.mean(axis=1), np.log(0.3)]),
        sd=np.array([*logs.std(axis=1), 0.8]),
    )


PRIOR = log_prior()


def shapes(theta, theta_c, C_rr, channels):
    """Heights for A = 1, by channel: all are proportional to A."""
    normal = LENGTH * np.abs(np.sin(theta))
    rolled = C_rr * normal
    unrolled = C_rr * np.tan(theta_c) * LENGTH * np.cos(theta)
    tangential = np.minimum(rolled, unrolled)
    if channels == ("height",):
        return [np.hypot(normal, tangential)]
    return [normal + 0 * tangential, tangential]


class Grid:
    """Posterior of one grasp on a grid of θ_c and ln C_rr."""

    def __init__(self, channels, sigma):
        self.channels, self.sigma = channels, sigma
        self.theta, self.heights = [], []
        edges = np.linspace(0, np.pi / 2, N_THETA_C + 1)
        self.theta_c = (edges[1:] + edges[:-1]) / 2
        self._lay(PRIOR.mean[2] - 4 * PRIOR.sd[2], PRIOR.mean[2] + 4 * PRIOR.sd[2])

    def _lay(self, low, high):
        """Lay the grid anew over a range of ln C_rr, and count all pushes again."""
        self.ln_C = np.linspace(low, high, N_C)
        t, c = np.log(np.tan(self.theta_c))[:, None], self.ln_C[None]
        (mA, mB, mC), (sA, sB, sC) = PRIOR.mean, PRIOR.sd
        # ln B = t + ln A + c: what is left for ln A, and for t given c.
        self.v = 1 / (1 / sA**2 + 1 / sB**2)
        self.mu = self.v * (mA / sA**2 + (mB - t - c) / sB**2)
        spread = sA**2 + sB**2
        self.log_prior = -((t + c - mB + mA) ** 2) / (2 * spread)
        self.log_prior = self.log_prior - (c - mC) ** 2 / (2 * sC**2)
        self.log_prior -= np.log(np.sin(self.theta_c) * np.cos(self.theta_c))[:, None]
        self.gg = np.zeros(t.shape[:1] + c.shape[1:])
        self.gh = np.zeros_like(self.gg)
        for theta, heights in zip(self.theta, self.heights, strict=True):
            self._count(theta, heights)
        self._weigh()

    def _count(self, theta, heights):
        parts = shapes(
            theta, self.theta_c[:, None], np.exp(self.ln_C)[None], self.channels
        )
        for g, h in zip(parts, heights, strict=True):
            self.gg = self.gg + (g / self.sigma) ** 2
            self.gh = self.gh + g * h / self.sigma**2

    def _weigh(self):
        """Weight of every cell, ln A integrated about its own optimum."""
        best = np.maximum(self.gh / np.maximum(self.gg, TINY), 1e-3)
        a = np.where(self.gg > 0, np.log(best), self.mu)
        for _ in range(6):
            A = np.exp(a)
            slope = (self.gh - self.gg * A) * A - (a - self.mu) / self.v
            curve = self.gg * A**2 + 1 / self.v
            a = a + np.clip(slope / curve, -0.5, 0.5)
        A = np.exp(a)
        self.a, self.curve = a, self.gg * A**2 + 1 / self.v
        log = self.log_prior + self.gh * A - self.gg * A**2 / 2
        log = log - (a - self.mu) ** 2 / (2 * self.v) - np.log(self.curve) / 2
        weights = np.exp(log - log.max())
        self.weights = weights / weights.sum()

    def add(self, theta, heights):
        """Take in one push."""
        self.theta.append(theta)
        self.heights.append(heights)
        self._count(theta, heights)
        self._weigh()
        by_C = self.weights.sum(axis=0)
        mean = by_C @ self.ln_C
        sd = np.sqrt(by_C @ (self.ln_C - mean) ** 2)
        there = self.ln_C[by_C > 1e-7 * by_C.max()]
        if sd < 3 * (self.ln_C[1] - self.ln_C[0]) and np.ptp(there) > 1e-3:
            step = self.ln_C[1] - self.ln_C[0]
            low, high = there.min() - step, there.max() + step
            if high - low < 0.7 * np.ptp(self.ln_C):
                self._lay(low, high)

    def interval(self):
        """Shortest interval of θ_c [deg]."""
        by_theta = self.weights.sum(axis=1)
        step = 90 / N_THETA_C
        angles = np.degrees(self.theta_c)
        target = AskedAngle(values=angles, is_axis=False, width=90.0, prob=PROB)
        low, high = shortest_interval(target, by_theta)
        return low - step / 2, high + step / 2

    def draws(self, n, rng):
        """A, θ_c and C_rr of n draws."""
        flat = self.weights.ravel()
        ticks = (np.arange(n) + rng.uniform()) / n
        cells = np.minimum(np.searchsorted(np.cumsum(flat), ticks), flat.size - 1)
        i, j = np.unravel_index(cells, self.weights.shape)
        u, w = rng.uniform(-0.5, 0.5, (2, n))
        theta_c = self.theta_c[i] + u * (np.pi / 2 / N_THETA_C)
        ln_C = self.ln_C[j] + w * (self.ln_C[1] - self.ln_C[0])
        a = self.a[i, j] + rng.standard_normal(n) / np.sqrt(self.curve[i, j])
        return np.exp(a), theta_c, np.exp(ln_C)

    def mode(self):
        """The likeliest cell: A, θ_c and C_rr."""
        i, j = np.unravel_index(np.argmax(self.weights), self.weights.shape)
        return np.exp(self.a[i, j]), self.theta_c[i], np.exp(self.ln_C[j])


def by_gain(grid, n, rng):
    """Expected information gain about θ_c."""
    A, theta_c, C = grid.draws(N_GAIN, rng)
    heights = np.stack(
        [np.stack([A * g for g in shapes(t, theta_c, C, grid.channels)]) for t in THETA]
    )
    sigma = np.full(len(grid.channels), grid.sigma)
    gains = information_gain(
        heights, [np.degrees(theta_c)], np.full(N_GAIN, 1 / N_GAIN), sigma=sigma
    )
    return float(THETA[np.argmax(gains)])


def by_d_optimality(grid, n, rng):
    """Largest determinant of the information at the best fit."""
    if n < 3:
        return float(THETA[(2, 8, 14)[n]])
    A, theta_c, C = grid.mode()
    steps = 1e-4 * np.eye(3)
    base = np.array([np.log(A), theta_c, np.log(C)])

    def jacobian(theta):
        rows = []
        for step in steps:
            up, down = base + step, base - step
            high = shapes(theta, up[1], np.exp(up[2]), grid.channels)
            low = shapes(theta, down[1], np.exp(down[2]), grid.channels)
            pairs = zip(high, low, strict=True)
            rows.append(
                [(np.exp(up[0]) * h - np.exp(down[0]) * k) / 2e-4 for h, k in pairs]
            )
        return np.array(rows)

    information = 1e-9 * np.eye(3)
    for theta in grid.theta:
        J = jacobian(theta)
        information = information + J @ J.T
    after = [information + (J := jacobian(t)) @ J.T for t in THETA]
    return float(THETA[np.argmax([np.linalg.slogdet(m)[1] for m in after])])


# The paper's elevations, thrice each: below the plane as above it [rad].
PAPER = np.radians(np.repeat(np.abs(np.arange(-60.0, 61.0, 15.0)), 3))
STRATEGIES: dict[str, Callable] = {
    "gain": by_gain,
    "D-optimal": by_d_optimality,
    "passes": lambda grid, n, rng: float(THETA[n % THETA.size]),
    "in order x 3": lambda grid, n, rng: float(THETA[(n // 3) % THETA.size]),
    "paper's grid": lambda grid, n, rng: float(PAPER[n % PAPER.size]),
    "random": lambda grid, n, rng: float(rng.choice(THETA)),
}


@dataclass(frozen=True)
class Truth:
    """One grasp, with its noise."""

    A: float
    theta_c: float
    C_rr: float
    sigma: float

    def feel(self, theta, channels, noise):
        """Heights of a push."""
        parts = shapes(theta, self.theta_c, self.C_rr, channels)
        return [self.A * float(g) + e for g, e in zip(parts, noise, strict=True)]


def truths(n, seed):
    """Grasps from the priors; noise is 3 % of the median height of the candidates."""
    rng = np.random.default_rng(seed)
    found = []
    for A, B, C in np.exp(PRIOR.mean + PRIOR.sd * rng.standard_normal((n, 3))):
        theta_c = float(np.arctan2(B, A * C))
        heights = A * shapes(THETA, theta_c, C, ("height",))[0]
        sigma = NOISE * float(np.median(heights))
        found.append(Truth(float(A), theta_c, float(C), sigma))
    return found


def stops(
    truth, choose, channels, widths, cap, *, seed, sigma_factor=1.0, by_sets=False
):
    """For each width: pushes until decided, and whether θ_c was in the interval."""
    rng = np.random.default_rng([seed, 1])
    noise = truth.sigma * np.random.default_rng([seed, 2]).standard_normal(
        (cap, len(channels))
    )
    grid = Grid(channels, sigma_factor * truth.sigma)
    sets = LikelihoodSets(truth.sigma, channels)
    found = dict.fromkeys(widths)
    for n in range(cap):
        theta = choose(grid, n, rng)
        felt = truth.feel(theta, channels, noise[n])
        grid.add(theta, felt)
        if by_sets:
            sets.add(theta, felt)
        low, high = sets.hull() if by_sets else grid.interval()
        for width in widths:
            if found[width] is None and high - low <= width:
                is_in = low <= np.degrees(truth.theta_c) <= high
                found[width] = (n + 1, bool(is_in))
        if all(found.values()):
            break
    return found


def sets_in_passes(truth, channels, widths, cap, *, seed):
    """Stops on likelihood sets, and whether θ_c is in them after fixed numbers."""
    noise = truth.sigma * np.random.default_rng([seed, 2]).standard_normal(
        (cap, len(channels))
    )
    sets = LikelihoodSets(truth.sigma, channels)
    found, fixed = dict.fromkeys(widths), {}
    for n in range(cap):
        theta = float(THETA[n % THETA.size])
        sets.add(theta, truth.feel(theta, channels, noise[n]))
        low, high = sets.hull()
        is_in = bool(low <= np.degrees(truth.theta_c) <= high)
        for width in widths:
            if found[width] is None and high - low <= width:
                found[width] = (n + 1, is_in)
        if n + 1 in FIXED:
            fixed[n + 1] = is_in
    return found, fixed


def describe(results: Sequence, cap: int) -> str:
    """Share decided / median pushes / coverage at the stop, ± its standard error."""
    decided = [r for r in results if r is not None]
    if not decided:
        return "0.00/-/-"
    share, n = len(decided) / len(results), len(decided)
    pushes = sorted(r[0] if r is not None else cap + 1 for r in results)
    middle = pushes[len(pushes) // 2]
    cover = np.mean([r[1] for r in decided])
    error = np.sqrt(PROB * (1 - PROB) / n)
    shown = "-" if middle > cap else str(middle)
    return f"{share:.2f}/{shown}/{cover:.3f}±{error:.3f}"


def compare(args) -> None:
    """One line for each strategy, truths and noise the same for all."""
    channels = CHANNELS[args.channels]
    worlds = truths(args.truths, args.seed)
    wanted = list(STRATEGIES) if args.strategies is None else args.strategies
    print(f"{args.channels}, cap {args.cap}, {args.truths} truths, seed {args.seed}")
    print("strategy".ljust(16), *(f"W <= {w:g}".rjust(22) for w in args.widths))
    cases = [(name, name, 1.0) for name in wanted]
    if args.control:
        cases.append(("gain", "sigma x 0.67", 0.67))
        cases.append(("gain", BY_SETS, 1.0))
    for name, label, factor in cases:
        start = time.perf_counter()
        found = [
            stops(
                world,
                STRATEGIES[name],
                channels,
                args.widths,
                args.cap,
                seed=k,
                sigma_factor=factor,
                by_sets=label == BY_SETS,
            )
            for k, world in enumerate(worlds)
        ]
        columns = [describe([f[w] for f in found], args.cap) for w in args.widths]
        print_row(label, columns, start)
    if args.control:
        start = time.perf_counter()
        both = [
            sets_in_passes(world, channels, args.widths, args.cap, seed=k)
            for k, world in enumerate(worlds)
        ]
        columns = [describe([f[w] for f, _ in both], args.cap) for w in args.widths]
        print_row("sets in passes", columns, start)
        for n in both[0][1]:
            share = np.mean([fixed[n] for _, fixed in both])
            print(f"  after {n} pushes, however wide: coverage {share:.3f}")


def print_row(label: str, columns: Sequence[str], start: float) -> None:
    """One line of the table, with the time that it took."""
    cells = (column.rjust(22) for column in columns)
    took = time.perf_counter() - start
    print(label.ljust(16), *cells, f"{took:6.0f} s", flush=True)


def source(table, question, seed) -> Belief:
    """Draws of the grid, as `pushfit.Explorer` takes beliefs."""
    sigma = question.sigma
    grid = Grid(question.channels, sigma)
    if table is not None:
        columns = [table.heights(c) for c in question.channels]
        for row, theta in enumerate(table.theta):
            grid.add(float(theta), [float(c[row]) for c in columns])
    A, theta_c, C = grid.draws(N_BELIEF_DRAWS, np.random.default_rng(seed))
    B, L = A * C * np.tan(theta_c), 0.04
    zero = np.zeros(N_BELIEF_DRAWS)
    return Belief(
        # Any springs with these A and B: K_st L² = C_d, K_sn = K_dn.
        samples={
            "K_sn": 2 * A,
            "K_dn": 2 * A,
            "K_st": 2 * B,
            "C_rr": C,
            "C_d": 2 * B * L**2,
            "L": np.full(N_BELIEF_DRAWS, L),
            "e1": zero,
            "e2": zero,
            "theta_c": np.degrees(theta_c),
        },
        log_weights=zero,
        scatter=np.zeros((len(question.channels), N_BELIEF_DRAWS)),
        sd=np.full(len(question.channels), sigma),
        is_sd_used=True,
        channels=question.channels,
        grasp=Grasp(push_length=LENGTH),
        likelihood="normal",
        is_guess=table is None,
    )


def run_explorer(args) -> None:
    """`pushfit.Explorer` with its forecasts: answers, and how many are wrong."""
    channels = CHANNELS[args.channels]
    for width in args.widths:
        answers, covered, pushes, gave_up, times = [], [], [], [], []
        for k, world in enumerate(truths(args.explorer, args.seed)):
            explorer = Explorer(
                CONFIG,
                width_deg=width,
                budget=args.cap,
                sigma=world.sigma,
                channels=channels,
                seed=k,
                source=source,
                limits=Limits(reference_every=0),
            )
            noise = np.random.default_rng([k, 2]).standard_normal(
                (args.cap, len(channels))
            )
            n = 0
            while True:
                start = time.perf_counter()
                suggestions = explorer.ask()
                times.append(time.perf_counter() - start)
                if not suggestions:
                    break
                push = suggestions[0]
                felt = world.feel(push.theta, channels, world.sigma * noise[n])
                explorer.tell(
                    push.theta, push.alpha, dict(zip(channels, felt, strict=True))
                )
                n += 1
            answer = explorer.state.answer
            answers.append(answer.value)
            if answer is Answer.DECIDED:
                low, high = explorer.state.intervals["theta_c"]
                covered.append(low <= np.degrees(world.theta_c) <= high)
                pushes.append(n)
            elif answer in (Answer.CANNOT, Answer.UNLIKELY):
                # What going on would have brought, by the same noise.
                found = stops(world, by_gain, channels, [width], args.cap, seed=k)
                gave_up.append(found[width] is not None)
        counts = {a: answers.count(a) for a in sorted(set(answers))}
        print(f"Explorer, {args.channels}, W <= {width:g}, {len(answers)} truths:")
        print(f"  answers {counts}")
        if covered:
            error = np.sqrt(PROB * (1 - PROB) / len(covered))
            print(
                f"  coverage at the stop {np.mean(covered):.3f}±{error:.3f}, median "
                f"{np.median(pushes):.0f} pushes"
            )
        if gave_up:
            print(
                f"  gave up {len(gave_up)}, of which the whole budget decides "
                f"{np.sum(gave_up)} ({np.sum(gave_up) / len(answers):.3f} of all)"
            )
        print(
            f"  ask: median {1e3 * np.median(times):.0f} ms, 99 % "
            f"{1e3 * np.quantile(times, 0.99):.0f} ms",
            flush=True,
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--channels", choices=CHANNELS, default="components")
    parser.add_argument("--truths", type=int, default=1000)
    parser.add_argument("--cap", type=int, default=40)
    parser.add_argument("--widths", type=float, nargs="+", default=[12.0, 6.0])
    parser.add_argument("--strategies", nargs="*", choices=STRATEGIES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--control", action="store_true")
    parser.add_argument("--explorer", type=int, default=0, metavar="TRUTHS")
    args = parser.parse_args()
    (run_explorer if args.explorer else compare)(args)


if __name__ == "__main__":
    main()
