"""Many tables side by side: against the engines for single tables, and each other."""

import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit import lane_results
from pushfit.fit.identify import identify_table
from pushfit.fit.lane_fit import SmallNormal, fit_lanes
from pushfit.fit.lane_profile import profile_lanes
from pushfit.fit.lane_results import identify_lanes, ready
from pushfit.fit.lanes import why_not_lane
from pushfit.fit.least_squares import fit_least_squares
from pushfit.fit.many import identify_many
from pushfit.model import Contact, Pushes, forward
from tests.fit.tables import case_table, config, setup_of
from tests.problems import CASES

ALPHA = np.pi / 2
# Elevations of all tables here: one compiled program.
NINE = np.array([8.0, 16.0, 24.0, 32.0, 42.0, 52.0, 62.0, 72.0, 82.0])
SCENES = (("firm", 0.1), ("firm", 0.005), ("paper", 0.05), ("paper", 0.3))


@pytest.fixture(scope="module")
def tables():
    """Sharp, wide, and one with two modes."""
    return [
        case_table(CASES[name], noise=noise, seed=seed, theta_deg=NINE)
        for seed, (name, noise) in enumerate(SCENES)
    ]


@pytest.fixture(scope="module")
def stacked(tables):
    """The tables in their lanes, with a full number of them."""
    items = [ready(table, config(), seed=0) for table in tables]
    return items, lane_results._stacked(list(enumerate(items)))


def test_heights_of_a_lane_are_those_of_the_model(stacked):
    items, _ = stacked
    lane, A, C_rr, theta_c = items[0].lane, 480.0, 0.35, np.radians(37.0)
    group = Contact(A=A, B=A * C_rr * np.tan(theta_c), C_rr=C_rr)
    wanted = forward(group, Pushes(lane.pushes.theta, lane.pushes.alpha), lane.grasp)
    face = lane.face(jnp.log(jnp.tan(theta_c)))
    heights = A * lane.shape(face, jnp.log(C_rr))
    assert np.allclose(heights[0], wanted.height, rtol=1e-12)


def test_the_misfit_of_pooled_repeats_is_that_of_all_heights(tables, stacked):
    items, _ = stacked
    problem = setup_of(tables[0]).problem
    y = jnp.log(jnp.array([480.0, 120.0, 0.35]))
    lane = items[0].lane
    face = lane.face(y[1] - y[0] - y[2])
    squares = lane.parabola(lane.shape(face, y[2])).squares(jnp.exp(y[0]))
    wanted = jnp.sum(problem.data_residuals(y) ** 2)
    assert float(sum(squares)) == pytest.approx(float(wanted), rel=1e-9)
    assert float(lane.log_likelihood(squares)) == pytest.approx(
        float(problem.log_likelihood(problem.data_state(y))), rel=1e-9
    )


def test_no_table_is_fitted_worse_than_by_itself(tables, stacked):
    _, lanes = stacked
    fits = fit_lanes(lanes)
    profiles = profile_lanes(lanes, fits)
    for i, table in enumerate(tables):
        single = fit_least_squares(setup_of(table), reference_alpha=ALPHA)
        best = float(jnp.min(profiles.misfit[i]))
        # A thousandth of the Δχ² of one standard deviation.
        assert best < single.chi_square + 1e-3


def test_a_result_does_not_depend_on_its_neighbours_or_their_order(tables):
    forward = identify_many(tables, config(), seeds=range(4), engine="auto")
    backward = identify_many(
        tables[::-1], config(), seeds=range(4)[::-1], engine="auto"
    )[::-1]
    (alone,) = identify_many(tables[2:3], config(), seeds=[2], engine="auto")
    for one, other in zip([*forward, forward[2]], [*backward, alone], strict=True):
        assert one.values == other.values
        for name, draws in one.draws.items():
            assert np.array_equal(draws, other.draws[name], equal_nan=True)


@pytest.mark.slow
def test_rows_say_what_a_single_table_says(tables):
    (row,) = identify_many(tables[:1], config(), seeds=[0], engine="auto")
    single = identify_table(tables[0], config(), seed=0, engine="sweep")
    theta_c = single.theta_c
    assert row.values["theta_c_verdict"] == theta_c.verdict.value
    width = theta_c.interval[1] - theta_c.interval[0]
    # Fits that stop 1e-4 apart in the noise weights move no quantile by more.
    for column, value in (
        ("theta_c_deg", theta_c.estimate),
        ("theta_c_low_deg", theta_c.interval[0]),
        ("theta_c_high_deg", theta_c.interval[1]),
    ):
        assert row.values[column] == pytest.approx(value, abs=0.03 * width)
    assert row.values["chi_square"] == pytest.approx(single.fit.chi_square, abs=1e-3)
    assert row.values["warnings"] == ";".join(w.code for w in single.warnings)
    assert row.values["engine"] == "sweep"


def test_an_unusable_table_leaves_its_neighbours_alone(tables):
    n_pushes = tables[1].n_pushes
    broken = tables[1].with_flag(range(n_pushes), "saturated")
    found = identify_many([tables[0], broken], config(), seeds=[0, 1], engine="auto")
    assert found[0].values["status"] == "ok"
    assert found[1].code == "no_usable_push"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[grasp]\npreload_n = 1.0\n", "preload"),
        ("[parameters.C_rr]\nfixed = 0.3\n", "fixed"),
        ("[parameters.L]\nuniform = { low = 0.03, high = 0.05 }\n", "edges"),
        ('[noise]\nlikelihood = "student_t"\n', "Student-t"),
    ],
)
def test_what_no_lane_holds_is_said(tables, text, reason):
    assert reason in why_not_lane(setup_of(tables[0], text).problem)


@pytest.mark.slow
def test_units_of_the_heights_change_stiffness_alone():
    newtons = case_table(CASES["firm"], noise=0.05, seed=3, theta_deg=NINE)
    frame = newtons.frame.rename(columns=lambda n: n.replace("_n", "_kpa"))
    heights = [n for n in frame if n.endswith("_kpa")]
    frame[heights] *= 7.3
    other = type(newtons).from_frame(frame)
    results = [
        identify_lanes([ready(table, config(), seed=0)])[0]
        for table in (other, type(other).from_frame(frame.assign(**frame[heights] * 2)))
    ]
    one, two = (r.posterior.samples for r in results)
    assert np.allclose(one["theta_c"], two["theta_c"], rtol=1e-6)
    assert np.allclose(2 * one["A"], two["A"], rtol=1e-6)


def test_cholesky_written_out_solves_normal_equations():
    rng = np.random.default_rng(0)
    matrix, vector = rng.normal(size=(12, 3)), rng.normal(size=12)

    class Operator:
        def as_matrix(self):
            return jnp.asarray(matrix)

    solver = SmallNormal()
    state = solver.init(Operator(), {})
    found, _, _ = solver.compute(state, jnp.asarray(vector), {})
    wanted = np.linalg.lstsq(matrix, vector, rcond=None)[0]
    assert np.allclose(found, wanted, rtol=1e-10)
