"""Every question from the hand to its answer, with truths that are known."""

import json
import os
import pty
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from pushfit.cli.app import main
from pushfit.cli.commands.explore import watched
from pushfit.data.tables.peak_table import PeakTable
from pushfit.explore.belief.from_fit import believe
from pushfit.explore.decide import stopping
from pushfit.explore.decide.forecast import UNLIMITED
from pushfit.explore.hands.simulated import SimulatedHand
from pushfit.explore.limits import Limits
from pushfit.explore.loop import Step, explore
from pushfit.explore.records import Answer, Purpose, State, Suggestion
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Parameters
from pushfit.parameters import HALF_TURN
from pushfit.report.figures.exploration import draw_course, exploration_picture
from pushfit.report.figures.style import symbol_label
from pushfit.report.store.read import read_result
from tests.cli.test_app import session
from tests.cli.test_progress import everything
from tests.explore.beliefs import PLAIN
from tests.explore.test_loop import FORCES, explorer, hand
from tests.explore.worlds import COMPONENTS, TRUTH_FILE
from tests.mechanics.test_own_mechanics import EXAMPLE, true_angle
from tests.tolerances import EXACT

pytestmark = pytest.mark.repeated

# A = 571 and B = 175 N/m at the mean of the ellipse, whose soft axis lies at 65°:
# e = 1.4 (cos 310°, sin 310°).
STRETCHED = Parameters(
    *(800.0, 2000.0, 400.0, 0.3, 0.5, 0.04),
    e1=1.4 * np.cos(np.radians(310.0)),
    e2=1.4 * np.sin(np.radians(310.0)),
)
ALPHA_STAR = 65.0
# The same as settings, for the commands.
STRETCHED_FILE = f"""\
{TRUTH_FILE}\
e1 = {{ fixed = 0.8999 }}
e2 = {{ fixed = -1.0725 }}
"""


def is_inside(truth, interval, period=np.inf):
    low, high = interval
    return 0 <= np.mod(truth - low, period) <= high - low


@pytest.mark.parametrize(
    "ask", [pytest.param("alpha_star", marks=pytest.mark.slow), "both"]
)
def test_a_hand_finds_the_soft_axis(ask):
    """Directions over elevation and azimuth, until each angle is within ± 20°.

    By the sweep: of draws from the prior no more than three or four would count.
    """
    own = explorer(ask=ask, width_deg=40.0, sigma=0.1, source=believe)
    state = explore(own, held(STRETCHED), settings=FORCES)
    assert state.answer is Answer.DECIDED
    assert is_inside(ALPHA_STAR, state.intervals["alpha_star"], HALF_TURN)
    if ask == "both":
        theta_c = float(np.degrees(critical_angle(STRETCHED, PLAIN, np.pi / 2)))
        assert is_inside(theta_c, state.intervals["theta_c"])
    assert len(state.intervals) == (2 if ask == "both" else 1)
    # An azimuth shows in nothing that is pushed along one.
    assert np.ptp(own.table.alpha) > 0


def held(params, *, seed=1):
    """A hand that holds another grasp."""
    return SimulatedHand(replace(hand().world, params=params), seed=seed)


def test_a_budget_that_is_too_small_is_foreseen():
    """To ± 0.5°: widths fall as the root of the pushes, and 2000 would decide."""
    budget, usual = 18, {"width_deg": 1.0, "sigma": 0.1}
    own = explorer(budget=budget, **usual)
    state = explore(own, hand(), settings=FORCES)
    assert state.answer is Answer.UNLIKELY
    assert state.p_budget == 0 < 0.05 < state.p_unlimited
    assert state.sentence.startswith("θ_c will hardly be decided to ± 0.5°: with")
    assert state.n_left == budget - state.n_pushes > 0
    low, high = state.intervals["theta_c"]
    assert (high - low) * np.sqrt(state.n_pushes / budget) > usual["width_deg"]
    # It was given up for want of pushes alone.
    more = explorer(budget=budget + 200, **usual)
    for push in own.history.told:
        more.tell(push.theta, push.alpha, push.heights)
    assert more.state.answer is Answer.DECIDING


@pytest.mark.parametrize(
    ("chances", "answer"),
    [
        ([0.5, 0.0, 0.0, 0.0, 0.0, 0.0], Answer.UNLIKELY),
        ([0.5, 0.0, 0.0, 0.0, 0.0], Answer.DECIDING),
        # Two truths of 48 are fewer than 5 %, and no reason to give up.
        ([0.5, 0.0, 0.0, 2 / 48, 0.0, 0.0], Answer.DECIDING),
    ],
)
def test_only_five_forecasts_without_a_decided_truth_give_up(
    chances, answer, monkeypatch
):
    told = iter(chances)

    def chance(imagined, weights, targets, *, n_pushes):
        return 1.0 if n_pushes == UNLIMITED else next(told)

    monkeypatch.setattr(stopping, "p_decided", chance)
    monkeypatch.setattr(stopping, "MIN_FORECAST", 0)
    own = explorer(width_deg=0.1, budget=len(chances) + 1)
    for _ in chances:
        own.tell(np.pi / 4, np.pi / 2, dict.fromkeys(COMPONENTS, 1.0))
    assert own.state.answer is answer


@pytest.mark.parametrize(
    ("chances", "answer"),
    [
        ([0.0] * 5, Answer.UNLIKELY),
        ([0.0, 0.0, 0.0, 0.0, 1 / 48], Answer.DECIDING),
    ],
)
def test_a_table_is_given_up_after_as_many_truths(chances, answer, monkeypatch):
    told = iter(chances)

    def chance(imagined, weights, targets, *, n_pushes):
        return 1.0 if n_pushes == UNLIMITED else next(told)

    theta = np.radians(np.repeat([10.0, 45.0, 80.0], 4))
    table = PeakTable.from_arrays(
        theta=theta,
        alpha=np.full(theta.size, np.pi / 2),
        heights=dict.fromkeys(COMPONENTS, np.ones(theta.size)),
        unit="n",
    )
    monkeypatch.setattr(stopping, "p_decided", chance)
    own = explorer(width_deg=0.1, sigma=2.0)
    own.attach(table)
    assert own.state.answer is answer
    assert list(told) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "ask", [pytest.param("alpha_star", marks=pytest.mark.slow), "both"]
)
def test_the_soft_axis_is_explored_and_read_back(ask, tmp_path, capsys):
    """From the command to the folder, by the engine and the peaks of a recording."""
    truth, settings = tmp_path / "truth.toml", tmp_path / "grasp.toml"
    truth.write_text(STRETCHED_FILE)
    settings.write_text("[push]\nlength_mm = 5.0\n")
    out = tmp_path / "out"
    command = ["explore", "--hand", "simulated", "--forces", "--ask", ask, "--json"]
    command += ["--width", "40", "--sigma", "0.05", "--noise", "0.01"]
    command += ["--truth", str(truth), "--config", str(settings), "--out", str(out)]
    assert main(command) == 0
    explored = json.loads(capsys.readouterr().out)["exploration"]
    assert explored["status"] == "decided"
    assert is_inside(ALPHA_STAR, explored["intervals_deg"]["alpha_star"], HALF_TURN)
    found = read_result(out)
    assert is_inside(ALPHA_STAR, found.alpha_star.interval, HALF_TURN)
    assert found.table.n_pushes == explored["n_pushes"]
    page = (out / "report.html").read_text("utf-8")
    assert main(["report", str(out)]) == 0
    assert capsys.readouterr().out == page


@pytest.mark.slow
def test_mechanics_of_ones_own_explore(own_mechanics, tmp_path, capsys):
    """Its θ_c is a degree or more from that of the paper's equations."""
    out = tmp_path / "out"
    command = ["explore", "--hand", "simulated", "--forces", "--json"]
    command += ["--width", "6", "--sigma", "0.05", "--noise", "0.01"]
    command += ["--config", str(EXAMPLE / "grasp.toml"), "--out", str(out)]
    assert main([*command, "--truth", str(EXAMPLE / "truth.toml")]) == 0
    explored = json.loads(capsys.readouterr().out)["exploration"]
    assert explored["status"] == "decided"
    assert is_inside(true_angle(), explored["intervals_deg"]["theta_c"])
    found = read_result(out)
    assert found.config.grasp.mechanics == "hertz"
    assert is_inside(true_angle(), found.theta_c.interval)


def test_a_terminal_shows_state_interval_and_chance_as_they_change(monkeypatch):
    reader, writer = pty.openpty()
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "xterm")
    with os.fdopen(writer, "w") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        with watched(session()) as watch:
            watch(step(number=1, fault=None, chance=None))
            watch(step(number=2, fault="stalled", chance=0.25))
        monkeypatch.undo()
    *_, last = everything(reader).split("state")
    assert "deciding" in last
    assert "θ_c 10.0° to 40.0°, chance 25%" in last
    assert "2, 58 left" in last
    # Both pushes are still to be seen.
    assert "gain push 1: θ = 30.0°, α = 90.0°" in last
    assert "gain push 2: θ = 30.0°, α = 90.0° failed: stalled" in last


def test_no_legend_of_the_map_hides_what_is_drawn():
    """With most directions out of limits, as many entries as there may be."""
    own = explorer(ask="both", limits=Limits(force=2.9))
    figure = exploration_picture(own, own.ask())
    figure.draw_without_rendering()
    *known, gains, bar = figure.axes
    # Both angles are asked for, and both are shown.
    assert [axes.get_xlabel() for axes in known] == [
        symbol_label(name, "°") for name in ("theta_c", "alpha_star")
    ]
    legend = gains.get_legend()
    assert legend is not None
    assert len(legend.get_texts()) == 3
    box = legend.get_window_extent()
    assert not any(box.overlaps(axes.bbox) for axes in (*known, gains, bar))


def step(*, number, fault, chance):
    """A push of an exploration, as whoever watches is told of it."""
    suggestion = Suggestion(
        number=number,
        theta=np.radians(30.0),
        alpha=np.radians(90.0),
        length_share=1.0,
        purpose=Purpose.GAIN,
        gain=0.5,
        expected_width=20.0,
        p_decided=0.1,
        force_q99=3.0,
    )
    state = State(
        answer=Answer.DECIDING,
        sentence="",
        intervals={"theta_c": (10.0, 40.0)},
        p_unlimited=None,
        p_budget=chance,
        n_pushes=number,
        n_left=60 - number,
    )
    return Step(suggestion=suggestion, fault=fault, state=state)


def test_an_axis_that_passes_its_end_does_not_leap_in_the_picture():
    """Intervals around 176°, 182° and 4° are of axes 6° and 2° apart."""
    ends = [(170.0, 182.0), (178.0, 186.0), (0.0, 8.0), None]
    course = [
        State(
            answer=Answer.DECIDING,
            intervals={"alpha_star": one},
            n_pushes=n,
            n_left=9,
            p_unlimited=None,
            p_budget=None,
            sentence="",
        )
        for n, one in enumerate(ends)
    ]
    axes = Figure().subplots()
    draw_course(axes, course, "alpha_star", is_axis=True)
    lower, upper = (line.get_ydata()[:3] for line in axes.lines)
    np.testing.assert_allclose(lower, [170.0, 178.0, 180.0], rtol=EXACT)
    np.testing.assert_allclose(upper, [182.0, 186.0, 188.0], rtol=EXACT)
