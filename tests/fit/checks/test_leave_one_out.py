"""A wrong height among heights whose noise nobody states."""

import numpy as np
import pytest
from scipy import stats

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks import leave_one_out
from pushfit.fit.checks.leave_one_out import (
    ALONE,
    DOUBT,
    LEVEL,
    WORTH,
    LeftOut,
    unpredicted,
)
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.results import FitResult, FitStatus, Identification
from tests.fit.tables import FRICTION_ONLY, HARD, SEVEN_DEG, case_table, config
from tests.problems import CASES, PUSH
from tests.tolerances import ROUTES

ALPHA = np.pi / 2
COMPONENTS = ("height_normal", "height_tangential")
# Of the tallest height.
NOISE = 0.005
# Of what the others predict: four times their noise.
NEAR = 4 * NOISE
# Noise of any kind, as by default.
OPEN = parse_config("[push]\nlength_mm = 5.0\n" + HARD, path="grasp.toml")


def judged(table: PeakTable, text: str = "") -> tuple[LeftOut, ...]:
    setup = settle_noise(build_problem(table, config(text)), ALPHA)
    whole = fit_least_squares(setup, reference_alpha=ALPHA)
    return unpredicted(setup, whole, reference_alpha=ALPHA)


def pushes(
    n: int, *, wrong: int | None = None, factor: float = 1.3, noise: float = NOISE
) -> PeakTable:
    """Pushes from 10° to 80°, one height of them wrong."""
    case = CASES["firm"]
    theta = np.radians(np.linspace(10.0, 80.0, n))
    rng = np.random.default_rng(3)
    clean = simulate_table(
        case.params,
        case.grasp,
        theta=theta,
        alpha=ALPHA,
        repeats=1,
        noise=0.0,
        rng=rng,
    ).heights("height")
    heights = clean + noise * np.max(clean) * rng.standard_normal(n)
    if wrong is not None:
        heights[wrong] = factor * clean[wrong]
    return PeakTable.from_arrays(
        theta=theta, alpha=np.full(n, ALPHA), heights={"height": heights}, unit="n"
    )


@pytest.mark.parametrize(
    ("wrong", "factor"), [(3, 0.7), (3, 1.3), (6, 0.7), (6, 1.3), (7, 1.3)]
)
def test_the_push_that_is_off_is_named_with_what_the_others_give(wrong, factor):
    """None at an end, which a kink of the model before it may explain.

    The last bends the fit so that two others are farther from it.
    """
    table = pushes(10, wrong=wrong, factor=factor)
    found = judged(table)[0]
    height = table.heights("height")[wrong]
    assert (found.row, found.channel, found.height) == (wrong, "height", height)
    np.testing.assert_allclose(found.predicted, height / factor, rtol=NEAR)
    assert found.p_value < LEVEL


def test_of_a_linear_problem_the_chance_is_that_of_the_deleted_residual(monkeypatch):
    """Below θ_c of C_rr alone: Student's t of a push from what the others predict.

    Two are off, and the farther one is named first in whatever order they are tried.
    """
    n = 22
    theta = np.radians(np.linspace(2.0, 30.0, n))
    slope = 400 * PUSH * np.sin(theta)
    heights = 0.25 * slope + NOISE * np.random.default_rng(0).standard_normal(n)
    heights[[5, 20]] += NOISE * np.array([30.0, 50.0])
    of_one = {"height_tangential": heights}
    table = PeakTable.from_arrays(
        theta=theta, alpha=np.full(n, ALPHA), heights=of_one, unit="n"
    )
    monkeypatch.setattr(leave_one_out, "_doubted", lambda *_: np.array([5, 20]))
    # Of two each hides the other.
    monkeypatch.setattr(leave_one_out, "LEVEL", 1.0)
    found = judged(table, FRICTION_ONLY)
    assert [one.row for one in found] == [20, 5]
    for one in found:
        is_other = np.arange(n) != one.row
        x, y = slope[is_other], heights[is_other]
        C = x @ y / (x @ x)
        variance = np.sum((y - C * x) ** 2) / (n - 2)
        predicted = C * slope[one.row]
        spread = variance * (1 + slope[one.row] ** 2 / (x @ x))
        t = np.abs(heights[one.row] - predicted) / np.sqrt(spread)
        np.testing.assert_allclose(one.predicted, predicted, rtol=ROUTES)
        # By Bonferroni.
        expected = n * 2 * stats.t.sf(t, n - 2)
        np.testing.assert_allclose(one.p_value, expected, rtol=ROUTES)


def test_pushes_are_doubted_by_their_deleted_residuals_or_where_they_stand_alone():
    """Least squares without each: the farthest first, then what others hardly know."""
    n, n_numbers = 14, 4
    rng = np.random.default_rng(2)
    held = [np.where(np.arange(n) == i, 1.0, 0.05) for i in (9, 6)]
    design = np.c_[np.ones(n), np.arange(n), *held]
    design[4, 2], design[2, 3] = -0.3, -0.4
    heights = 5 + design @ [1.0, 0.1, 1.0, 1.0] + 0.1 * rng.standard_normal(n)
    heights[[3, 11]] += [0.9, -0.7]
    table = PeakTable.from_arrays(
        theta=np.radians(np.linspace(10.0, 80.0, n)),
        alpha=np.full(n, ALPHA),
        heights={"height": heights},
        unit="n",
    )
    predicted = design @ np.linalg.lstsq(design, heights)[0]
    whole = FitResult(
        names=("a", "b", "c", "d"),
        estimate=np.zeros(n_numbers),
        covariance=np.eye(n_numbers),
        jacobian=design,
        singular_values=np.ones(n_numbers),
        modes=(),
        chi_square=float(np.sum((heights - predicted) ** 2)),
        n_data=n,
        n_free=n_numbers,
        sigma=np.ones(n),
        predicted=predicted,
        channel=("height",) * n,
        row=tuple(range(n)),
        status=FitStatus.OK,
    )
    chances, unknown = [], []
    for i in range(n):
        x, y = np.delete(design, i, 0), np.delete(heights, i)
        fitted, rest, *_ = np.linalg.lstsq(x, y)
        unknown.append(design[i] @ np.linalg.inv(x.T @ x) @ design[i])
        freedom = n - 1 - n_numbers
        spread = np.sqrt(rest[0] / freedom * (1 + unknown[-1]))
        t = np.abs(heights[i] - design[i] @ fitted) / spread
        chances.append(n * 2 * stats.t.sf(t, freedom))
    far = [i for i in np.argsort(chances).tolist() if chances[i] < DOUBT]
    alone = [i for i in range(n) if unknown[i] > (1 - ALONE) / ALONE and i not in far]
    found = leave_one_out._doubted(build_problem(table, config()), whole)
    assert found.tolist() == far + sorted(alone, key=lambda i: -unknown[i])
    assert alone == [6, 9]


def test_where_noise_is_stated_a_push_that_is_off_by_more_is_far_from_the_fit():
    """Which says it; what the others scatter by is known without them."""
    table = pushes(10, wrong=3)
    stated = table.frame.assign(height_sd_n=NOISE * np.max(table.heights("height")))
    assert judged(PeakTable.from_frame(stated)) == ()


def spoiled(table: PeakTable, *, column: str, row: int, factor: float) -> PeakTable:
    heights = table.frame[column].to_numpy(copy=True)
    heights[row] *= factor
    return PeakTable.from_frame(table.frame.assign(**{column: heights}))


def several(channels: tuple[str, ...], repeats: int, *, is_stated: bool) -> PeakTable:
    """A few pushes with noise of 1 %, in which nothing looks like tails."""
    case = CASES["firm"]
    theta_deg = SEVEN_DEG if repeats > 1 else np.linspace(8.0, 85.0, 12)
    noise = 2 * NOISE * float(np.max(case_table(case).heights("height")))
    words = {"theta_deg": theta_deg, "repeats": repeats, "channels": channels}
    table = case_table(case, noise=noise, seed=4, **words)
    stated = [f"{name}_sd_n" for name in channels if not is_stated]
    return PeakTable.from_frame(table.frame.drop(columns=stated))


@pytest.mark.parametrize(
    ("channels", "repeats", "is_stated", "row", "factor"),
    [
        pytest.param(COMPONENTS, 1, True, 4, 0.1, marks=pytest.mark.slow),
        (COMPONENTS, 1, False, 6, 10.0),
        (("height",), 3, False, 13, 10.0),
    ],
)
def test_a_slip_is_named_that_is_most_of_the_noise_of_its_channel(
    channels, repeats, is_stated, row, factor
):
    """Or that looks as if noise had tails, or repeats differed as a whole."""
    table = several(channels, repeats, is_stated=is_stated)
    wrong = spoiled(table, column=f"{channels[-1]}_n", row=row, factor=factor)
    clean, found = (
        [w.text for w in identified(one).warnings if w.code == "outliers"]
        for one in (table, wrong)
    )
    assert clean == []
    (text,) = found
    assert f"push {wrong.frame['push'].iloc[row]} " in text


def identified(table: PeakTable) -> Identification:
    return identify_table(table, OPEN, seed=0, is_brief=True)


def test_heights_that_are_right_are_not_faulted():
    assert judged(pushes(10)) == ()


@pytest.mark.parametrize(("share", "n_named"), [(WORTH / 2, 0), (2 * WORTH, 1)])
def test_what_is_off_by_less_than_matters_is_left_alone(share, n_named):
    """Heights to the last digit would fault a model that is a little off."""
    table = pushes(10, noise=1e-4)
    heights = table.heights("height").copy()
    heights[3] += share * np.max(heights)
    off = table.frame.assign(height_n=heights)
    assert len(judged(PeakTable.from_frame(off))) == n_named


def test_too_few_pushes_say_nothing_of_one():
    """Three unknowns and a kink go through five heights of six."""
    assert judged(pushes(6, wrong=3)) == ()


def test_an_identification_names_the_push_although_its_noise_has_heavy_tails_then():
    column, row = "height_tangential_n", 4
    table = several(COMPONENTS, 1, is_stated=False)
    table = spoiled(table, column=column, row=row, factor=2.0)
    found = identified(table)
    assert found.config.noise.likelihood == "student_t"
    (text,) = [w.text for w in found.warnings if w.code == "outliers"]
    name, height = "push 5 (θ = 36°, α = 90°)", table.frame[column].iloc[row]
    assert text.startswith(f"{name} has {column} = {height:.3g} where the others give")
    assert found.goodness_of_fit.outliers == (name,)
