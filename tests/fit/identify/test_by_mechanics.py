"""Both mechanics of one table: what is heard, in which order, and who leads."""

import pytest

from pushfit.config import parse_config
from pushfit.errors import FitError
from pushfit.fit.identify import by_mechanics
from pushfit.fit.identify.fitted import Fitted, Listener
from pushfit.fit.identify.progress import Stages, stages_of
from pushfit.fit.problem.setup import build_problem
from tests.report.makers import make_answer, make_fit, make_posterior, make_table

TABLE = make_table(with_alpha=False)
BOTH = parse_config(
    "[push]\nlength_mm = 5.0\n[parameters.L]\nfixed = 0.04\n", path="grasp.toml"
)


class Hearing(Listener):
    """Notes what it hears."""

    def __init__(self):
        self.heard = []

    def searched(self, setup):
        self.heard.append("first look")

    def fitted(self, fitted):
        self.heard.append(f"best fit, {fitted.config.grasp.mechanics}")

    def confined(self, fitted, theta_c):
        self.heard.append(f"set, {fitted.config.grasp.mechanics}")


@pytest.fixture
def fit_table(monkeypatch):
    """Fits that take no time; mechanics that are added to it have none."""
    failing = []

    def fit_table(table, config, *, searching):
        if config.grasp.mechanics in failing:
            raise FitError("no finite start", code="no_finite_start")
        setup = build_problem(table, config)
        if searching is not None:
            searching(setup)
        return Fitted(
            table=table,
            config=config,
            setup=setup,
            fit=make_fit(table),
            reference_alpha=0.0,
            warnings=(),
        )

    def answer(fitted, posterior, theta_c):
        return make_answer(fitted.mechanics)

    swept = make_posterior(with_alpha=False)
    monkeypatch.setattr(by_mechanics, "fit_table", fit_table)
    monkeypatch.setattr(by_mechanics, "profiles_of", lambda fitted, wanted: {})
    monkeypatch.setattr(by_mechanics, "sweep", lambda fitted, seed: swept)
    monkeypatch.setattr(by_mechanics, "mechanics_answer", answer)
    return failing


def both_fitted():
    """The fit that leads, the others, what was heard, and the stages begun."""
    hearing, begun = Hearing(), []
    stages = Stages(stages_of(BOTH, "auto"), lambda stage, share: begun.append(stage))
    fitted, others = by_mechanics.fitted_by_leading(
        TABLE, BOTH, seed=0, stages=stages, hearing=hearing
    )
    return fitted, others, hearing.heard, begun


def test_what_is_done_side_by_side_is_heard_in_turn(fit_table):
    fitted, others, heard, begun = both_fitted()
    assert heard == [
        "first look",
        *("best fit, linear", "set, linear"),
        *("best fit, tilting", "set, tilting"),
    ]
    assert begun == list(stages_of(BOTH, "auto")[:3])
    assert [fitted.mechanics, *(one.mechanics for one in others)] == [
        "linear",
        "tilting",
    ]
    assert list(fitted.swept) == [0]


def test_mechanics_that_cannot_be_fitted_are_said_and_stop_nothing(fit_table):
    fit_table.append("tilting")
    fitted, others, heard, _ = both_fitted()
    assert others == ()
    assert heard == ["first look", "best fit, linear", "set, linear"]
    (warning,) = fitted.warnings
    assert warning.code == "one_mechanics"
    assert "no fit by tilting mechanics: no finite start" in warning.text


def test_without_the_first_mechanics_there_is_no_answer(fit_table):
    fit_table.append("linear")
    with pytest.raises(FitError, match="no finite start"):
        both_fitted()
