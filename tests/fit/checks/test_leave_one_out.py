"""A wrong height among heights whose noise nobody states."""

import numpy as np
import pytest

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.leave_one_out import LEVEL, WORTH, LeftOut, unpredicted
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.results import Identification
from tests.fit.tables import HARD, SEVEN_DEG, case_table, config
from tests.problems import CASES

ALPHA = np.pi / 2
COMPONENTS = ("height_normal", "height_tangential")
# Of the tallest height.
NOISE = 0.005
# Of what the others predict: four times their noise.
NEAR = 4 * NOISE
# Noise of any kind, as by default.
OPEN = parse_config("[push]\nlength_mm = 5.0\n" + HARD, path="grasp.toml")


def judged(table: PeakTable) -> tuple[LeftOut, ...]:
    setup = settle_noise(build_problem(table, config()), ALPHA)
    whole = fit_least_squares(setup, reference_alpha=ALPHA)
    return unpredicted(setup, whole, reference_alpha=ALPHA)


def pushes(n: int, *, wrong: int | None = None, factor: float = 1.3) -> PeakTable:
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
    heights = clean + NOISE * np.max(clean) * rng.standard_normal(n)
    if wrong is not None:
        heights[wrong] = factor * clean[wrong]
    return PeakTable.from_arrays(
        theta=theta, alpha=np.full(n, ALPHA), heights={"height": heights}, unit="n"
    )


@pytest.mark.parametrize("factor", [0.7, 1.3])
@pytest.mark.parametrize("wrong", [3, 6])
def test_the_push_that_is_off_is_named_with_what_the_others_give(wrong, factor):
    """None at an end, which a kink of the model before it may explain."""
    table = pushes(10, wrong=wrong, factor=factor)
    found = judged(table)[0]
    height = table.heights("height")[wrong]
    assert (found.row, found.channel, found.height) == (wrong, "height", height)
    np.testing.assert_allclose(found.predicted, height / factor, rtol=NEAR)
    assert found.p_value < LEVEL


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


def test_what_is_off_by_less_than_matters_is_left_alone():
    """Heights to the last digit would fault a model that is a little off."""
    table = pushes(10)
    clean = judged(table)
    heights = table.heights("height").copy()
    heights[9] += WORTH / 2 * np.max(heights)
    off = table.frame.assign(height_n=heights)
    assert judged(PeakTable.from_frame(off)) == clean == ()


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
