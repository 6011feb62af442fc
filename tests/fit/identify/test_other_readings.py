"""Tables whose columns mean something else than their names say."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.data.simulate import simulate_table
from pushfit.fit.assess.warnings import improbable
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.identify.other_readings import other_reading
from tests.fit.tables import SEVEN_DEG, case_table, config, without_sd
from tests.problems import CASES

BOTH = ("height_normal", "height_tangential")
# Of a height in N: the model describes what is misread within it.
COARSE = 0.12


def misread_by_angle(table):
    frame = table.frame
    return replace(table, frame=frame.assign(theta_deg=90.0 - frame["theta_deg"]))


def exchanged(table):
    names = table.frame.columns.tolist()
    swapped = [
        name.replace("normal", "?")
        .replace("tangential", "normal")
        .replace("?", "tangential")
        for name in names
    ]
    return replace(table, frame=table.frame.set_axis(swapped, axis=1))


def codes_of(result):
    return {warning.code for warning in result.warnings}


def test_elevations_from_the_normal_are_found_where_the_model_fits_all_the_same():
    table = case_table(CASES["firm"], noise=COARSE, seed=1)
    found = identify_table(misread_by_angle(table), config(), seed=1, engine="sweep")
    (warning,) = [w for w in found.warnings if w.code == "other_reading"]
    assert "theta_deg is counted from the normal" in warning.text
    assert found.goodness_of_fit.lack_of_fit_p_value > 0.001
    assert "but far better" in found.goodness_of_fit.sentence
    assert found.theta_c.interval is None
    assert found.theta_c.sets == ()


def test_what_a_table_tells_that_cannot_be_right_is_provisional():
    """Equal heights are those of a contact with A C_rr = B, without any noise."""
    table = case_table(CASES["firm"], noise=0.02, seed=1)
    table = replace(table, frame=table.frame.assign(height_n=1.5))
    found = identify_table(table, config(), seed=1, is_brief=True)
    assert found.goodness_of_fit.sentence.endswith("but the table cannot be right.")
    for quantity in (found.theta_c, *found.combinations):
        assert quantity.interval is None
        assert quantity.verdict.value in ("provisional", "not_determined", "assumed")


def test_a_misread_table_that_passes_all_checks_is_named():
    """Without repeats, and with no noise stated, nothing else speaks against it."""
    case, theta = CASES["firm"], np.radians(np.linspace(10.0, 80.0, 9))
    table = simulate_table(
        case.params,
        case.grasp,
        theta=theta,
        alpha=np.pi / 2,
        repeats=1,
        noise=COARSE,
        rng=np.random.default_rng(1),
    )
    found = identify_table(
        misread_by_angle(table), config(), seed=1, engine="sweep", is_brief=True
    )
    assert found.goodness_of_fit.p_value is None
    assert improbable(config(), found.posterior) == ()
    assert "other_reading" in codes_of(found)
    assert "but far better" in found.goodness_of_fit.sentence


def test_channels_that_are_exchanged_are_named():
    words = {"channels": BOTH, "theta_deg": SEVEN_DEG}
    table = case_table(CASES["firm"], noise=0.03, seed=1, **words)
    fitted = fit_table(exchanged(without_sd(table)), config())
    warning = other_reading(fitted, seed=1)
    assert "height_normal and height_tangential are exchanged" in warning.text


@pytest.mark.parametrize("channels", [("height",), BOTH])
def test_a_table_that_is_read_as_it_was_made_has_no_other_reading(channels):
    table = case_table(CASES["firm"], noise=COARSE, seed=1, channels=channels)
    assert other_reading(fit_table(table, config()), seed=1) is None


def test_heights_without_order_have_no_other_reading():
    table = case_table(CASES["firm"], noise=0.03, seed=1, theta_deg=SEVEN_DEG)
    heights = np.random.default_rng(0).permutation(table.heights("height"))
    frame = table.frame.assign(height_n=heights)
    assert (
        other_reading(fit_table(replace(table, frame=frame), config()), seed=1) is None
    )


def test_an_elevation_below_the_surface_is_counted_from_no_normal():
    table = misread_by_angle(case_table(CASES["firm"], noise=COARSE, seed=1))
    frame = table.frame.copy()
    frame.loc[0, "theta_deg"] = -1.0
    assert (
        other_reading(fit_table(replace(table, frame=frame), config()), seed=1) is None
    )


def test_heights_in_a_unit_a_hundredth_of_what_is_stated_are_improbable():
    """The truth of the case in full newtons is probable."""
    table = case_table(CASES["firm"], noise=0.03, seed=1)
    columns = ["height_n", "height_sd_n"]
    small = table.frame.assign(**{c: table.frame[c] / 100 for c in columns})
    told = {}
    for name, one in (("N", table), ("cN", replace(table, frame=small))):
        found = identify_table(one, config(), seed=1, engine="sweep")
        told[name] = improbable(config(), found.posterior)
        assert ("far_from_prior" in codes_of(found)) is bool(told[name])
    assert told == {"N": (), "cN": ("A", "B")}
