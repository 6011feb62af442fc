"""The page in a real browser: clicked, typed into, saved; by day and at night."""

import json
import shlex
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

from pushfit.cli import main
from pushfit.data.simulate import write_recording
from tests.cli.look.chromium import BROWSER, chromium
from tests.cli.look.makers import FAINT, HUMPS, LOW, NEAR, TOUCH, recording
from tests.cli.look.test_server import looking
from tests.report.figures.test_components import BEGINS, THREE, forces

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here"),
]
SIZES = {"desktop": (1280, 1000), "phone": (390, 844)}
READY = (
    "document.readyState == 'complete' && window.Bokeh && Bokeh.documents.length > 0"
    " && Bokeh.documents[0].is_idle"
)
# What follows finds a view of Bokeh by its model, and its place on the screen.
VIEWS = """(() => {
  const all = v => [v, ...(v.child_views ?? []).flatMap(all)];
  const views = all([...Bokeh.index.roots][0]);
  const one = test => views.find(v => test(v.model));
  %s
})()"""
POINT = """
  const plot = one(m => m.type == 'Figure'), box = plot.el.getBoundingClientRect();
  return [box.left + plot.frame.x_scale.compute(%r), box.top + 150];"""
CELL = """
  const table = one(m => m.type == 'DataTable').shadow_el;
  const row = table.querySelectorAll('.slick-row')[%d];
  const cell = row.querySelectorAll('.slick-cell')[%d];
  const box = cell.getBoundingClientRect();
  return [box.left + box.width / 2, box.top + box.height / 2, cell.textContent];"""
FIELD = """
  const own = one(m => m.title == %r || m.label == %r).shadow_el;
  const box = own.querySelector('input, button').getBoundingClientRect();
  return [box.left + box.width / 2, box.top + box.height / 2];"""
WORDS = """
  return views.filter(v => v.model.type == 'Div').map(v => v.model.text).join('\\n');"""
FRAMES = """
  return views.filter(v => v.model.type == 'Figure').map(v => {
    const {left, right} = v.frame.bbox, box = v.el.getBoundingClientRect();
    return [box.left + left, box.left + right, box.top];
  });"""
BELOW = """
  const plot = views.filter(v => v.model.type == 'Figure')[2];
  const box = plot.el.getBoundingClientRect();
  return [box.left + plot.frame.x_scale.compute(%r), box.top + 50];"""
PUSH, COUNTS, HEIGHT, THETA = 0, 1, 3, 4


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_recording(recording(), tmp_path / "a.csv")
    return tmp_path


@pytest.fixture
def tab(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("profile")) as tab:
        yield tab


def view(tab, script, *values):
    return tab.run(VIEWS % (script % values))


def open_page(tab, address, *, size="desktop", dark=False):
    width, height = SIZES[size]
    tab.show(address, width=width, height=height, dark=dark)
    tab.until(READY)
    tab.until(VIEWS % (CELL % (0, HEIGHT)))
    time.sleep(0.5)  # fonts and the last frame


def press(tab, name):
    tab.click(*view(tab, FIELD, name, name))


def wait_for(tab, words):
    tab.until(f"{VIEWS % WORDS}.includes({words!r})")


def test_a_push_is_clicked_away_angles_are_typed_and_what_is_saved_is_used(tab, place):
    with looking(place) as (_, address):
        open_page(tab, address)
        wait_for(tab, "5 pushes count")
        tab.click(*view(tab, POINT, HUMPS[TOUCH][0]))
        wait_for(tab, "4 pushes count")
        assert view(tab, CELL, TOUCH, COUNTS)[2] == "no"
        numbers = [view(tab, CELL, k, PUSH)[2] for k in range(len(HUMPS))]
        assert numbers == ["1", "2", "–", "3", "–", "4"]

        # Enter leads to the next line, as in any table.
        tab.click(*view(tab, CELL, 0, THETA)[:2])
        tab.type("10\n20\n\n30\n")
        wait_for(tab, "0 have their angles")
        assert [view(tab, CELL, k, THETA)[2] for k in range(4)] == [
            "10",
            "20",
            "",
            "30",
        ]

        press(tab, "θ of a plan [deg]")
        tab.type("0:45:15\n")
        press(tab, "α of a plan [deg]")
        tab.type("90\n")
        press(tab, "Fill in")
        wait_for(tab, "4 pushes count, 4 have their angles")
        press(tab, "Save")
        wait_for(tab, "saved; next, in a terminal: pushfit identify a.csv")
        own = address.split("//")[1].split("/")[0]
        asked = [a for a in tab.addresses if not a.startswith("data:")]
        assert {a.split("//")[1].split("/")[0] for a in asked} == {own}
        assert tab.complaints == []
        told = (
            tab.run(VIEWS % WORDS).split("in a terminal: pushfit ")[1].splitlines()[0]
        )
    assert main([*shlex.split(told), "--out", "result"]) == 0
    assert json.loads(Path("result/summary.json").read_text())["n_pushes"] == 4
    table = pd.read_csv("result/peaks.csv")
    assert table["theta_deg"].tolist() == [0.0, 15.0, 30.0, 45.0]
    kept = np.array([h for k, h in enumerate(HUMPS) if k not in (TOUCH, FAINT)])
    np.testing.assert_allclose(table["t_peak_s"], kept[:, 0], atol=NEAR)
    np.testing.assert_allclose(table["height_n"], kept[:, 1], rtol=LOW)


def test_what_was_decided_is_there_when_the_page_is_loaded_again(tab, place):
    with looking(place) as (_, address):
        open_page(tab, address)
        tab.click(*view(tab, POINT, HUMPS[TOUCH][0]))
        wait_for(tab, "4 pushes count")
        open_page(tab, address)
        wait_for(tab, "4 pushes count")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_the_page_is_drawn_and_fits_the_screen(tab, place, size, dark):
    assert main(["look", "a.csv", "--export", "page.html"]) == 0
    with looking(place) as (_, address):
        for name, where in (
            ("live", address),
            ("static", (place / "page.html").as_uri()),
        ):
            open_page(tab, where, size=size, dark=dark)
            assert tab.run("document.documentElement.scrollWidth") <= SIZES[size][0]
            picture = place / f"{name}.png"
            tab.picture(picture)
            pixels = imread(picture)[..., :3]
            # Most of it is paper.
            assert (np.median(pixels) < 0.3) == dark
            colours = {tuple(row) for row in pixels[::5, ::5].reshape(-1, 3).tolist()}
            assert len(colours) > 20
    assert tab.complaints == []


@pytest.mark.parametrize("size", SIZES)
def test_components_are_in_time_below_the_length_of_their_change(tab, place, size):
    write_recording(forces(THREE), place / "a.csv")
    (place / "grasp.toml").write_text('[peaks]\nnormal = "-fz"\n')
    with looking(place, "--config", "grasp.toml") as (_, address):
        open_page(tab, address, size=size)
        left, right, top = np.array(view(tab, FRAMES)).T
        assert len(top) == 4
        assert (np.diff(top) > 0).all()
        # The first has its tools at the right.
        assert np.ptp(left) < 1
        assert np.ptp(right) < 1
        assert tab.run("document.documentElement.scrollWidth") <= SIZES[size][0]
        tab.click(*view(tab, BELOW, float(BEGINS[1]) + 1.0))
        wait_for(tab, "3 pushes count")
    assert tab.complaints == []


def test_names_of_a_user_are_words_in_a_browser_too(tab, place):
    name = "<img src=x onerror=\"document.title='owned'\">.csv"
    (place / "a.csv").rename(place / name)
    assert main(["look", name, "--export", "page.html"]) == 0
    open_page(tab, (place / "page.html").as_uri())
    assert tab.run("document.title").startswith("pushfit look: <img")
    assert tab.run("document.querySelectorAll('img').length") == 0
    assert tab.complaints == []
