"""The page without a browser: what it shows, and what a click or a typed cell does."""

import re

import pytest
from bokeh.events import ButtonClick, Tap
from bokeh.models import (
    Button,
    Checkbox,
    ColumnDataSource,
    DataTable,
    Div,
    Plot,
    TextInput,
)

from pushfit.cli.look.page import Page, static_page
from tests.cli.look.makers import DIP, FAINT, HUMPS, LOW, NEAR, TOUCH, a_look, markup

# Runs if any text of a user is taken for markup.
ATTACK = "<img src=x onerror=\"document.title='owned'\">.csv"


@pytest.fixture
def look():
    return a_look()


@pytest.fixture
def saved():
    return []


@pytest.fixture
def page(look, saved):
    return Page(look, title="a.csv", save=lambda own: saved.append(own) or "kept it")


def one(page, kind, **attributes):
    return page.root.select_one({"type": kind, **attributes})


def told(page) -> str:
    return "\n".join(div.text for div in page.root.select({"type": Div}))


def cells(page) -> dict[str, list]:
    return dict(one(page, DataTable).source.data)


def tap(page, when):
    plot = one(page, Plot)
    plot._trigger_event(Tap(plot, x=when, y=3.0))


def press(page, label):
    (button,) = [b for b in page.root.select({"type": Button}) if b.label == label]
    button._trigger_event(ButtonClick(button))


def test_what_counts_is_numbered_and_has_its_height(page):
    shown = cells(page)
    assert shown["push"] == ["1", "2", "3", "4", "–", "5"]
    assert shown["counts"][FAINT] == "no"
    assert shown["height"][FAINT] == ""
    heights = [float(h) for k, h in enumerate(shown["height"]) if k != FAINT]
    truth = [h for k, (_, h) in enumerate(HUMPS) if k != FAINT]
    assert heights == pytest.approx(truth, rel=LOW)


def test_a_click_in_the_picture_leaves_a_hump_out_and_another_takes_it_in(page, look):
    before = cells(page)
    tap(page, HUMPS[TOUCH][0])
    assert not look.counts[TOUCH]
    assert cells(page)["push"] == ["1", "2", "–", "3", "–", "4"]
    assert "4 pushes count" in told(page)
    tap(page, HUMPS[TOUCH][0])
    assert cells(page) == before


def test_a_click_beside_all_humps_does_nothing(page, look):
    tap(page, 19.0)
    tap(page, None)
    assert look.counts == [k != FAINT for k in range(len(HUMPS))]


def test_cells_that_are_typed_are_taken_over(page, look):
    source: ColumnDataSource = one(page, DataTable).source
    source.patch({"theta": [(1, "15")]})
    source.patch({"alpha": [(1, "90")]})
    source.patch({"counts": [(TOUCH, "no")]})
    assert (look.theta_deg[1], look.alpha_deg[1]) == (15.0, 90.0)
    assert not look.counts[TOUCH]
    assert "4 pushes count, 1 have their angles" in told(page)


def test_a_cell_that_is_no_angle_says_so_and_stays_as_it_was(page, look):
    one(page, DataTable).source.patch({"theta": [(0, "15x")]})
    assert "theta = '15x' is no list of angles" in told(page)
    assert cells(page)["theta"][0] == ""


def test_a_plan_is_filled_in_and_saved(page, look, saved):
    fields = {field.title[0]: field for field in page.root.select({"type": TextInput})}
    fields["θ"].value, fields["α"].value = "0:60:15", "90"
    press(page, "Fill in")
    assert cells(page)["theta"] == ["0", "15", "30", "45", "", "60"]
    press(page, "Save")
    assert saved == [look]
    assert "kept it" in told(page)


def test_what_cannot_be_saved_says_why(look):
    def refuse(own):
        own.schedule()
        return ""

    page = Page(look, title="a.csv", save=refuse)
    press(page, "Save")
    assert "error: 5 of 5 pushes have no angles" in told(page)


def test_dips_are_shown_as_soon_as_pushes_go_both_ways():
    page = Page(a_look(*HUMPS, DIP), title="a.csv", save=lambda own: "")
    assert len(cells(page)["push"]) == len(HUMPS)
    one(page, Checkbox, label="pushes go both ways").active = True
    assert len(cells(page)["push"]) == len(HUMPS) + 1
    lowest = min(float(height) for height in cells(page)["height"] if height)
    assert lowest == pytest.approx(DIP[1], rel=LOW)


def test_seconds_since_1970_are_counted_from_the_first():
    look = a_look()
    look = type(look)(_later(look.recording, 1.7e9), look.config)
    page = Page(look, title="a.csv", save=lambda own: "")
    assert float(cells(page)["time"][0]) == pytest.approx(HUMPS[0][0], abs=NEAR)
    tap(page, HUMPS[TOUCH][0])
    assert not look.counts[TOUCH]


def _later(recording, seconds):
    return type(recording)(
        time=recording.time + seconds,
        channels=recording.channels,
        units=recording.units,
    )


def test_an_inverted_signal_is_drawn_with_its_heights_upwards():
    look = a_look()
    turned = type(look.recording)(
        time=look.recording.time,
        channels={"force": -look.recording.channels["force"]},
        units=look.recording.units,
    )
    peaks = look.config.peaks.model_copy(update={"invert": True})
    look = type(look)(turned, look.config.model_copy(update={"peaks": peaks}))
    page = Page(look, title="a.csv", save=None)
    (marks,) = {r.data_source for r in one(page, Plot).renderers if _is_marks(r)}
    assert marks.data["rest"][0] == pytest.approx(3, abs=LOW)
    assert marks.data["height"][0] == pytest.approx(4, abs=LOW)


def _is_marks(renderer) -> bool:
    return "rest" in renderer.data_source.data


def test_components_are_drawn_by_the_length_of_their_change():
    look = a_look()
    forces = look.recording.channels["force"]
    both = type(look.recording)(
        time=look.recording.time,
        channels={"fz": 0.8 * forces, "fx": 0.6 * forces},
        units={"fz": "n", "fx": "n"},
    )
    peaks = look.config.peaks.model_copy(update={"normal": "fz"})
    look = type(look)(both, look.config.model_copy(update={"peaks": peaks}))
    page = Page(look, title="a.csv", save=None)
    whole = next(part for part in page.root.children if isinstance(part, Plot))
    (marks,) = {r.data_source for r in whole.renderers if _is_marks(r)}
    assert marks.data["rest"][0] == 0
    assert marks.data["height"][0] == pytest.approx(HUMPS[0][1], rel=LOW)
    assert float(cells(page)["height_normal"][0]) == pytest.approx(0.8, rel=LOW)


def test_a_page_to_look_at_has_nothing_to_press_and_loads_nothing(look):
    page = Page(look, title="a.csv", save=None)
    assert not list(page.root.select({"type": Button}))
    text = static_page(look, title="a.csv")
    assert "default-src 'none'" in text
    assert markup(text).count("<script") > 3
    assert not re.findall(r"\b(?:src|href)=", markup(text))


def test_a_name_is_never_markup(look):
    assert ATTACK not in static_page(look, title=ATTACK)
