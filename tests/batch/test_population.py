"""What a batch says of its items together."""

import re
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy import stats

from pushfit.batch.folders import REPORT
from pushfit.batch.run import identify_batch
from pushfit.fit.identify.identify_many import ItemResult
from tests.batch.makers import outputs, read_csv, write_tables

NAMES = ("a", "b", "c", "d", "far")
Z = stats.norm.ppf((np.arange(400) + 0.5) / 400)
UNITS = {"d": "hPa/m"}


def identify(
    tables, config, *, seeds, engine, far="theta_c_not_determined", azimuth=178.0
):
    """Items alike but for one, with its warnings; d has another unit."""
    found = []
    for table in tables:
        name = table.sources[0].path.rpartition("/")[2].removesuffix(".csv")
        place = NAMES.index(name) if name in NAMES else 0
        draws = {
            "theta_c_deg": (70.0 if name == "far" else 30.0 + place) + Z,
            "ln_A": 6 + place / 10 + 0.1 * Z,
        }
        draws |= {f"log_prior_{column}": np.zeros(400) for column in draws}
        unit = UNITS.get(name, "N/m")
        values = {"status": "ok", "theta_c_deg": 30.0, "A_unit": unit}
        values["reference_alpha_deg"] = azimuth if name == "a" else 178.0
        if name == "far":
            values["warnings"] = far
        found.append(ItemResult(values=values, draws=draws))
    return found


@pytest.fixture
def runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_tables(tmp_path / "runs", *NAMES)


def test_the_population_and_the_page_are_written_and_written_alike(runs, tmp_path):
    found = identify_batch(["runs"], "out", identify=identify)
    first = outputs(tmp_path / "out")
    written = {path.name for path in found.files}
    assert {"population.csv", "report.html"} <= written
    identify_batch(["runs"], "out", identify=identify)
    assert outputs(tmp_path / "out") == first


def test_items_of_one_unit_are_one_population(runs, tmp_path):
    """d is in hPa/m, alone, so that A has four items; the angle has all five."""
    identify_batch(["runs"], "out", identify=identify)
    angle, A = read_csv(tmp_path / "out" / "population.csv")
    assert (angle["quantity"], angle["unit"], angle["n_items"]) == (
        "theta_c",
        "deg",
        "5",
    )
    assert (A["quantity"], A["unit"], A["n_items"]) == ("ln_A", "N/m", "4")
    assert angle["outliers"] == "runs/far.csv"
    assert float(A["mean_low"]) < 6 + (0 + 1 + 2 + 4) / 40 < float(A["mean_high"])


@pytest.mark.parametrize(
    ("verdict", "said"),
    [(None, ""), ("fixed", ""), ("assumed", "open_transition")],
)
def test_a_sharpness_that_items_leave_open_is_said_of_what_it_moves(
    runs, tmp_path, verdict, said
):
    def made(tables, config, **options):
        items = identify(tables, config, **options)
        return [
            replace(item, values={**item.values, "p_verdict": verdict})
            for item in items
        ]

    found = identify_batch(["runs"], "out", identify=made)
    assert {row["warnings"] for row in found.population} == {said}
    page = (tmp_path / "out" / REPORT).read_text()
    assert ("Mind: items leave the sharpness p" in page) is bool(said)
    assert ("Mind" in page) is bool(said)


@pytest.mark.parametrize(("azimuth", "said"), [(1.0, ""), (88.0, "several_azimuths")])
def test_angles_of_several_azimuths_are_not_pooled_without_a_word(
    azimuth, said, runs, tmp_path
):
    """At 178° and at 1°, which are 3° apart; A is that of all azimuths."""
    found = identify_batch(["runs"], "out", identify=partial(identify, azimuth=azimuth))
    assert [row["warnings"] for row in found.population] == [said, ""]


def test_what_has_no_interval_of_its_own_is_not_pooled(runs, tmp_path):
    """Without `far`, θ_c is 30° to 33°: the mean of these, and nothing outlying."""
    wrong = partial(identify, far="equal_heights;model_inadequate")
    found = identify_batch(["runs"], "out", identify=wrong)
    angle, A = found.population
    for row in (angle, A):
        assert (row["n_left_out"], row["provisional"]) == (1, "runs/far.csv")
        assert row["outliers"] == ""
    assert angle["mean_low"] < 31.5 < angle["mean_high"] < 40
    assert 'note">runs/far.csv</td>' in (tmp_path / "out" / "report.html").read_text()


def test_items_are_named_in_order(runs):
    def wrong(tables, config, **options):
        items = identify(tables, config, **options)
        names = [table.sources[0].path for table in tables]
        return [
            replace(item, values={**item.values, "warnings": "model_inadequate"})
            if name.endswith(("a.csv", "far.csv"))
            else item
            for name, item in zip(names, items, strict=True)
        ]

    angle = identify_batch(["runs"], "out", identify=wrong).population[0]
    assert angle["provisional"] == "runs/a.csv;runs/far.csv"
    assert angle["n_items"] == 3


def test_the_page_shows_the_population_and_every_item(runs, tmp_path):
    write_tables(runs, "x")
    (runs / "x.toml").write_text("[push]\nlenght_mm = 3.0\n")
    identify_batch(["runs"], "out", identify=identify)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index("Population") < page.index("<h2>Items")
    assert re.search(r'note">runs/far\.csv</td>', page)
    assert "length_mm" in page  # why x failed


def test_two_items_and_a_copy_are_no_population(runs, tmp_path):
    for name in ("c", "d", "far"):
        (runs / f"{name}.csv").unlink()
    shutil.copy(runs / "a.csv", runs / "again.csv")
    found = identify_batch(["runs"], "out", identify=identify)
    assert len(found.rows) == 3
    assert found.population == ()
    assert read_csv(tmp_path / "out" / "population.csv") == []
