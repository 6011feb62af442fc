"""A result in the hand: what it prints, shows, converts to and is saved as."""

import copy
import re
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib
import numpy as np
import pytest
from arviz_stats.base import array_stats

import pushfit
from pushfit.errors import ConfigError
from pushfit.fit.results import Verdict
from pushfit.report.html import result as html_module
from pushfit.report.result import Result, Value, load
from pushfit.report.store import folder as folder_module
from pushfit.report.text.result import render_text
from tests.report.makers import make_quantity
from tests.tolerances import EXACT, ROUNDING

# Of four chains of 500 independent draws.
MIXED = 0.02

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def result(determined):
    return Result.of(determined)


def test_its_repr_is_one_line_with_both_answers(any_identification):
    shown = repr(Result.of(any_identification))
    assert "\n" not in shown
    assert len(shown) < 250
    assert "θ_c" in shown
    assert "α*" in shown


def test_it_is_equal_to_itself_alone_and_may_be_in_a_set(result):
    again = copy.copy(result)
    assert result in {result}
    assert result not in [again]


def test_its_text_is_the_report(result, determined):
    assert str(result) == render_text(determined)


def test_a_parameter_is_a_number_with_a_format(result, determined):
    (stated,) = [q for q in determined.parameters if q.name == "K_sn"]
    value = result.params["K_sn"]
    assert float(value) == stated.estimate
    assert f"{value:.1f}" == f"{stated.estimate:.1f}"
    assert str(value) == f"{value}"
    assert "N/m" in str(value)
    assert float(result.theta_c) == pytest.approx(40.123, rel=EXACT)


def test_a_name_that_no_parameter_has_is_answered_by_those_there_are(result):
    with pytest.raises(KeyError, match="is called K_sm; there are K_sn, K_dn"):
        result.params["K_sm"]
    assert "K_sm" not in result.params


def test_what_may_not_be_quoted_is_no_number(two_modes, unknown_length):
    with pytest.raises(ValueError, match="several modes"):
        float(Result.of(two_modes).theta_c)
    with pytest.raises(ValueError, match="K_sn has no single estimate"):
        float(Result.of(unknown_length).params["K_sn"])


@pytest.mark.parametrize(
    ("verdict", "text"),
    [
        (Verdict.NOT_DETERMINED, "not determined"),
        (Verdict.ABSENT, "does not exist"),
        (Verdict.ONE_SIDED, "above 77.0 N/m, one-sided"),
        (Verdict.DETERMINED, "not quoted"),
    ],
)
def test_without_an_estimate_the_text_says_what_there_is(determined, verdict, text):
    (stated,) = [q for q in determined.combinations if q.name == "B"]
    sets = ((77.0, None),) if verdict is Verdict.ONE_SIDED else ()
    open_ = {"estimate": None, "interval": None, "verdict": verdict, "sets": sets}
    value = Value.of(replace(stated, **open_, note=""))
    assert str(value) == f"{value}" == text


def test_what_a_rejected_model_gives_is_shown_but_no_number(inadequate):
    theta_c = Result.of(inadequate).theta_c
    assert theta_c.estimate is not None
    assert str(theta_c).endswith("° provisional")
    assert repr(theta_c) == f"<theta_c: {theta_c}>"
    for number in (float, "{:.1f}".format):
        with pytest.raises(ValueError, match="theta_c has no single estimate: prov"):
            number(theta_c)


def test_the_frame_begins_with_the_angles(result):
    frame = result.to_frame()
    assert list(frame.index[:2]) == ["theta_c", "alpha_star"]
    assert frame.loc["theta_c", "estimate"] == pytest.approx(40.123, rel=EXACT)
    assert list(frame["kind"].unique()) == ["angle", "parameter", "combination"]


def test_tables_have_a_row_for_every_number(result):
    n_rows = len(result.to_frame())
    markdown = result.to_markdown().splitlines()
    assert len(markdown) == n_rows + 2
    assert len({line.count(" | ") for line in markdown}) == 1
    latex = result.to_latex()
    assert latex.count(r"\\") == n_rows + 1
    assert r"$\theta_c$ & 40" in latex
    assert r" & unit & verdict \\" in latex


def test_a_latex_table_escapes_what_users_write(hostile):
    parameters = (make_quantity("K_sn", 1.0, unit=r"N_\input{x} & 5%"),)
    latex = Result.of(hostile).to_latex()
    assert r"\input" not in latex
    latex = Result.of(replace(hostile, parameters=parameters)).to_latex()
    assert r"N\_\textbackslash{}input\{x\} \& 5\%" in latex


class Tags(HTMLParser):
    """Names of all elements, and those left open."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.seen, self.open = set(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.seen.add(tag)
        assert not any(name.startswith("on") for name, _ in attrs)
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_a_notebook_shows_a_card(any_identification):
    card = Result.of(any_identification)._repr_html_()
    tags = Tags(card)
    assert tags.open == []
    assert tags.seen <= {
        *("div", "p", "img", "details", "summary", "ul", "li"),
        *("table", "tr", "th", "td", "sub", "abbr"),
    }
    assert "data:image/png;base64," in card
    assert "http" not in re.sub(r"data:[^\"]*", "", card) or "x.invalid" in card


def test_a_notebook_shows_every_figure_without_pyplot(result):
    figure = result.plot()
    assert figure._repr_png_().startswith(PNG)
    assert result.plot("theta_c")._repr_png_().startswith(PNG)


@pytest.mark.parametrize("name", ["theta", "alpha", "theta_c", "learned"])
def test_a_figure_of_one_panel_goes_into_given_axes(result, name):
    figure = matplotlib.figure.Figure()
    left, right = figure.subplots(1, 2)
    assert result.plot(name, ax=right) is figure
    assert right.has_data()
    assert not left.has_data()


def test_walkers_are_chains_for_arviz(make_identification, determined):
    """Draws in the order of the sampler: step by step, all walkers of a step."""
    n_ensembles, n_steps, n_walkers, _ = determined.posterior.chain.shape
    n = n_ensembles * n_steps * n_walkers
    numbered = {"A": np.arange(n, dtype=float)}
    posterior = replace(
        determined.posterior, samples=numbered, log_prob=np.zeros(n), prior_samples={}
    )
    tree = Result.of(make_identification(posterior=posterior)).to_datatree()
    stored = tree["posterior"]["A"].to_numpy()
    assert stored.shape == (n_ensembles * n_walkers, n_steps)
    np.testing.assert_array_equal(stored[3, :2], [3, 3 + n_ensembles * n_walkers])


def test_walkers_are_chains_where_draws_are_a_shuffled_part_of_them(result):
    """A hand-made result: 2000 draws beside chains of 2 x 8 walkers and 50 steps."""
    tree = result.to_datatree()
    chain = result.posterior.chain
    assert dict(tree["posterior"].sizes) == {"chain": 16, "draw": 50}
    np.testing.assert_array_equal(
        tree["posterior"]["ln_B"].to_numpy()[9], chain[1, :, 1, 1]
    )
    np.testing.assert_allclose(
        tree["posterior"]["B"], np.exp(tree["posterior"]["ln_B"]), rtol=ROUNDING
    )
    assert tree["draws"]["C_rr"].size == result.posterior.log_prob.size


def test_r_hat_is_a_number(determined, make_identification):
    independent = replace(determined.posterior, chain=None, engine="sweep")
    tree = Result.of(make_identification(posterior=independent)).to_datatree()
    draws = tree["posterior"]["A"].to_numpy()
    rhat = array_stats.rhat(draws, chain_axis=0, draw_axis=1)
    assert float(rhat) == pytest.approx(1.0, abs=MIXED)


def test_it_comes_back_as_it_was_saved(result, tmp_path, monkeypatch):
    monkeypatch.setattr(folder_module, "figure_files", lambda _, **__: {})
    monkeypatch.setattr(html_module, "figure_files", lambda _, **__: {})
    result.save(tmp_path / "out")
    again = load(tmp_path / "out")
    assert str(again) == str(result)
    np.testing.assert_array_equal(
        again.posterior.samples["C_rr"], result.posterior.samples["C_rr"]
    )
    with pytest.raises(ConfigError, match="force"):
        result.save(tmp_path / "out")


def test_saving_warns_of_what_a_missing_library_leaves_out(
    result, tmp_path, monkeypatch
):
    monkeypatch.setattr(folder_module, "figure_files", lambda _, **__: {})
    for module in ("output_folder", "folder"):
        place = f"pushfit.report.store.{module}.find_spec"
        monkeypatch.setattr(place, lambda name: None)
    said = r"report.html and corner plots will be left out.*pip install '.\[report\]'"
    with pytest.warns(UserWarning, match=said):
        result.save(tmp_path / "out")
    assert not (tmp_path / "out" / "report.html").exists()


def test_an_explored_one_keeps_journal_and_picture(result, tmp_path, monkeypatch):
    """Saved, read, saved and read again; no identification makes them anew."""
    monkeypatch.setattr(folder_module, "figure_files", lambda _, **__: {})
    monkeypatch.setattr(html_module, "figure_files", lambda _, **__: {})
    extra = {"journal.jsonl": b"{}", "exploration.png": PNG}
    replace(result, extra=extra).save(tmp_path / "first")
    load(tmp_path / "first").save(tmp_path / "second")
    for name, content in extra.items():
        assert (tmp_path / "second" / name).read_bytes() == content
    assert load(tmp_path / "second").extra == extra


def test_the_result_of_a_result_is_itself(result):
    assert Result.of(result) is result


def test_every_field_of_a_verdict_is_kept(result):
    assert result.theta_c.verdict is Verdict.DETERMINED
    assert isinstance(result.theta_c, pushfit.Value)
