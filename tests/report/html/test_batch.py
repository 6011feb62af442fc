"""The page of a batch: every item is there, drawn to one scale, and none can attack."""

import base64
import hashlib
import json
import re

import numpy as np
import pandas as pd
import pytest

from pushfit.parameters import NAMED
from pushfit.report.answers import theta_c_answer
from pushfit.report.html.batch import render_batch
from tests.report.html.test_result import ALLOWED, Page
from tests.report.makers import HOSTILE, make_angle

# Start and width are rounded to 0.1 each.
ROUNDED = 0.11

TAGS = ALLOWED | set("svg line rect circle script details summary".split())


@pytest.fixture
def frame():
    """Three results and a failure, with the columns that `batch` writes."""
    return pd.DataFrame(
        {
            "item": ["a.csv", "b.csv", "c.csv", "d.csv"],
            "status": ["ok", "ok", "ok", "failed"],
            "theta_c_deg": [40.0, None, 20.0, None],
            "theta_c_low_deg": [38.0, None, 10.0, None],
            "theta_c_high_deg": [42.0, None, 30.0, None],
            "theta_c_sets": [
                "[[37.5, 41.5]]",
                json.dumps([[30.0, 32.0], [50.0, None]]),
                "[[10.0, 30.0]]",
                None,
            ],
            "theta_c_verdict": ["determined", "several_modes", "determined", None],
            "A": [500.0, 510.0, 90_000.0, np.nan],
            "A_low": [490.0, 500.0, 80_000.0, np.nan],
            "A_high": [510.0, 520.0, 99_000.0, np.nan],
            "A_unit": ["N/m"] * 4,
            "chi_square_p_value": [0.46, 0.0001, np.nan, np.nan],
            "warnings": ["", "large_tilt;few_pushes", None, None],
        }
    )


def rows(page: str) -> list[str]:
    """Rows of the table of items."""
    table = page[page.index('class="sortable"') :]
    return re.findall(r"<tr><th scope=\"row\".*?</tr>", table, re.DOTALL)


def test_every_item_has_a_row_with_its_numbers(frame):
    page = render_batch(frame)
    first, second, third, fourth = rows(page)
    assert "40.0°" in first
    assert "38.0° to 42.0°" in first  # the interval, as the item's own report has it
    assert "30.0° to 32.0° or above 50°" in second
    assert "several modes" in second
    assert "large_tilt, few_pushes" in second
    assert "&lt; 0.001" in second
    assert "90000 N/m" in third
    assert 'class="bad">failed' in fourth
    assert "<svg" not in fourth
    assert "4 items, 3 with a result" in page


def bars(row: str) -> list[tuple[float, float]]:
    """Ends of the bars of a row, in hundredths of the picture."""
    found = re.findall(r'<rect x="([\d.]+)" y="2" width="([\d.]+)"', row)
    return [(float(x), float(x) + float(width)) for x, width in found]


@pytest.mark.parametrize(
    ("period", "estimate", "interval"),
    [
        (180.0, "3.0°", "174.0° to 180° and on to 7.0°"),
        (None, "183.0°", "174.0° to 187.0°"),
    ],
)
def test_an_axis_alone_starts_again_after_a_half_turn(
    frame, period, estimate, interval
):
    row = {"alpha_star_deg": 183.0, "alpha_star_verdict": "determined"}
    row |= {"alpha_star_period_deg": period}
    row |= {"alpha_star_low_deg": 174.0, "alpha_star_high_deg": 187.0}
    first = rows(render_batch(frame.assign(**row)))[0]
    assert f">{estimate}<" in first
    assert f">{interval}<" in first


@pytest.mark.parametrize(
    ("estimate", "low", "high"),
    [
        (40.1234, 40.120, 40.126),
        (40.0, 38.0, 42.0),
        (34.0, None, None),
    ],
)
def test_an_angle_has_the_digits_that_the_report_of_its_item_has(
    estimate, low, high, frame, make_identification
):
    interval = None if low is None else (low, high)
    angle = make_angle("theta_c", estimate, interval=interval)
    sentence = theta_c_answer(make_identification(theta_c=angle)).sentence
    row = {"theta_c_deg": estimate, "theta_c_verdict": "determined"}
    row |= {"theta_c_low_deg": low, "theta_c_high_deg": high, "theta_c_sets": None}
    first = rows(render_batch(frame.assign(**row)))[0]
    value, shown = re.search(
        r'<strong>(.*?)</strong> <span class="range">(.*?)</span>', first
    ).groups()
    assert f" is {value}" in sentence
    assert f"interval: {shown})." in sentence if shown else low is None


def test_an_item_is_marked_sorted_and_judged_by_its_numbers(frame):
    """The scale is from 8.8° to 51.2°, its ends are those of the intervals."""
    first, second, third, _ = rows(render_batch(frame))
    place = float(re.search(r'<circle cx="([\d.]+)"', first).group(1))
    np.testing.assert_allclose(place, 100 * (40 - 8.8) / 42.4, atol=ROUNDED)
    keys = [re.findall(r'data-sort="(.*?)"', row)[0] for row in (first, second, third)]
    assert keys == ["40.0", "", "20.0"]
    assert '<td class="number">0.46</td>' in first


@pytest.mark.parametrize(
    ("name", "lows", "is_log"),
    [("theta_c", 3.0, False), ("A", 60.0, False), ("A", 30.0, True)],
)
def test_ten_times_is_a_wide_scale_but_of_angles(name, lows, is_log):
    """The middle of bars from `lows` to 400 and from 200 to 400."""
    end = "_deg" if name == "theta_c" else ""
    page = render_batch(
        pd.DataFrame(
            {
                f"{name}{end}": [300.0, 300.0],
                f"{name}_low{end}": [lows, 200.0],
                f"{name}_high{end}": [400.0, 400.0],
            }
        )
    )
    assert (", logarithmic" in page) == is_log
    ((_, _),), ((start, _),) = map(bars, rows(page))
    margin = 0.03 * (400 - lows)
    expected = (200 - lows + margin) / (400 - lows + 2 * margin)
    if is_log:
        expected = np.log(200 / lows) / np.log(400 / lows)
    np.testing.assert_allclose(start, 100 * expected, atol=ROUNDED)


def test_bars_of_all_items_share_one_scale(frame):
    """10° and 50° are the ends, with a margin of 3 % of the 40° between."""
    first, second, third, _ = rows(render_batch(frame))
    width = 40.0 * 1.06
    expected = [100 * (angle - 10 + 1.2) / width for angle in (38, 42)]
    np.testing.assert_allclose(bars(first)[0], expected, atol=ROUNDED)
    assert bars(second)[1][1] == 100.0  # open above
    assert bars(third)[0][0] < bars(first)[0][0]


def test_quantities_over_decades_are_drawn_over_their_logarithm(frame):
    (low, high), *_ = bars(rows(render_batch(frame))[0])[1:]
    span = np.log(99_000 / 490)
    expected = [0.0, 100 * np.log(510 / 490) / span]
    np.testing.assert_allclose([low, high], expected, atol=ROUNDED)


def test_a_frame_with_hardly_any_column_is_shown():
    page = render_batch(pd.DataFrame({"item": ["x"], "status": ["ok"]}))
    assert "1 items" not in page
    assert ">x</th>" in page


def test_the_population_comes_before_the_items(frame):
    row = {
        "quantity": "theta_c",
        "unit": "deg",
        "mean": 31.2,
        "mean_low": 29.0,
        "mean_high": 33.4,
        "spread": 4.0,
        "spread_low": 3.0,
        "spread_high": 6.0,
        "n_items": 5,
        "outliers": "c.csv",
        "not_usable": "d.csv;e.csv",
        "provisional": "b.csv",
    }
    page = render_batch(frame, [row])
    text = Page(page).text
    assert "31.2 (29.0 to 33.4)" in text
    assert page.index("Population") < page.index("<h2>Items")
    names = ["c.csv", "d.csv, e.csv", "b.csv"]
    assert re.findall(r'<td class="note">(.*?)</td>', page) == names
    assert re.findall(r'<td class="number">(.*?)</td>', page)[0] == "5"


def test_headings_and_rows_say_on_hover_what_a_letter_is(frame):
    mark = f'<abbr title="{NAMED["A"].meaning}">A</abbr>'
    page = render_batch(frame, [{"quantity": "ln_A", "mean": 6.2}])
    assert f'<th scope="col">{mark}' in page
    assert f'<th scope="row">{mark}</th>' in page
    assert NAMED["theta_c"].meaning in page


def test_nothing_of_a_user_is_markup():
    frame = pd.DataFrame(
        {
            "item": [HOSTILE],
            "status": [HOSTILE],
            "warnings": [HOSTILE],
            "message": [HOSTILE],
            "A": [1.0],
            "A_unit": [HOSTILE],
            "A_verdict": [HOSTILE],
        }
    )
    row = {"quantity": HOSTILE, "unit": HOSTILE, "outliers": HOSTILE}
    page = Page(render_batch(frame, [row], title=HOSTILE))
    assert {tag for tag, _ in page.tags} <= TAGS
    assert [tag for tag, _ in page.tags].count("script") == 1
    for _, attributes in page.tags:
        assert not [name for name in attributes if name.startswith("on")]
        assert "style" not in attributes
    assert not {"\x1b", "\u202e"} & set(page.text)


def test_the_policy_names_the_one_script_by_its_hash(frame):
    page = render_batch(frame)
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src &#39;sha256-{digest}&#39;" in page or (
        f"script-src 'sha256-{digest}'" in page
    )
    assert "unsafe" not in page


def test_a_spread_that_may_be_zero_is_a_bound(frame):
    row = {"quantity": "ln_A", "mean": 6.2, "spread": None, "spread_high": 0.3}
    text = Page(render_batch(frame, [row])).text
    assert "a factor below 1.35" in text


def test_a_population_is_in_units_and_its_spread_a_ratio():
    """ln 520 = 6.2538; a spread of 0.2 is a factor of 1.22."""
    row = {"quantity": "ln_A", "unit": "N/m", "mean": np.log(520.0), "n_items": 9}
    row |= {"mean_low": np.log(500.0), "mean_high": np.log(540.0), "spread": 0.2}
    page = render_batch(pd.DataFrame({"item": ["a"]}), [row])
    assert "520 (500 to 540)" in page
    assert "a factor of 1.22" in page
    assert "ln A" not in page


def test_a_failed_item_is_one_line_and_its_folder_a_link():
    frame = pd.DataFrame(
        {
            "item": ["a.csv", "b.csv"],
            "status": ["failed", "ok"],
            "message": ["line 3: no number; " * 30, None],
            "link": [None, "items/b.csv-12/report.html"],
        }
    )
    page = render_batch(frame)
    assert "<details><summary>what went wrong</summary>line 3" in page
    assert '<a href="items/b.csv-12/report.html">b.csv</a>' in page
    headings = re.findall(r'<th scope="col">(\w+)', page)
    assert headings[:3] == ["item", "status", "warnings"]
