"""Explorations that go on with their journal, and journals that are refused."""

import contextlib
import json

import pytest

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError, DataError
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits
from pushfit.explore.records import Answer
from pushfit.model import Parameters
from tests.explore.explorers import explorer, hopeless_table, run
from tests.explore.worlds import (
    COMPONENTS,
    SIGMA,
    importance,
)

SOFTER = Parameters(K_sn=500, K_dn=1200, K_st=400, C_rr=0.3, C_d=0.5, L=0.04)

# A line of a journal, but for its heights.
TOLD = (
    '{"event": "told", "number": 1, "theta": 0.5, "alpha": 1.5, "heights": %s, '
    '"sd": null, "length_share": 1.0, "flags": "", "is_attached": false, '
    '"purpose": null}'
)


def test_a_journal_knows_its_hand_again(tmp_path):
    """JSON has no tuples; a hand that is not named may be any."""
    path = tmp_path / "run.jsonl"
    explorer(journal=path, hand={"arm": ("left", 2)})
    explorer(journal=path, hand={"arm": ("left", 2)})
    explorer(journal=path)
    with pytest.raises(ConfigError, match=r"hand\.arm"):
        explorer(journal=path, hand={"arm": ("left", 3)})


def test_a_journal_that_says_0_for_no_number_is_gone_on_with(tmp_path):
    path = tmp_path / "run.jsonl"
    own = explorer(journal=path)
    own.fail(own.ask(2)[1], "stalled")
    text = path.read_text()
    assert text.count('"number": null') == 1
    path.write_text(text.replace('"number": null', '"number": 0'))
    assert explorer(journal=path).history == own.history


def test_a_push_that_the_process_does_not_outlive_is_asked_twice(tmp_path):
    """Once is chance; then other directions come first, three of them at most."""
    path, asked = tmp_path / "journal.jsonl", []
    while suggestions := explorer(journal=path).ask():
        asked.append(suggestions[0].theta)
    assert asked[0] == asked[1]
    assert len(set(asked)) == len(asked) - 1 == 3
    assert "interrupted" in explorer(journal=path).state.sentence


def test_a_table_is_attached_again_by_the_program_that_goes_on(tmp_path):
    path, table = tmp_path / "journal.jsonl", hopeless_table()
    own = explorer(journal=path)
    own.attach(table)
    before = path.read_bytes()
    again = explorer(journal=path)
    again.attach(table)
    assert path.read_bytes() == before
    assert again.history.told == own.history.told
    frame = table.frame.assign(height_normal_n=2 * table.frame["height_normal_n"])
    with pytest.raises(DataError) as error:
        again.attach(PeakTable.from_frame(frame))
    assert error.value.code == "attached_late"


def test_what_failures_stopped_goes_on_once_they_are_put_right(tmp_path):
    path = tmp_path / "run.jsonl"
    usual = {"journal": path, "limits": Limits(max_failures=2)}
    own = explorer(**usual)
    for _ in range(2):
        own.fail(own.ask()[0], "stalled")
    assert explorer(**usual).state.answer is Answer.STOPPED
    again = explorer(**usual)
    again.go_on()
    assert again.state.answer is Answer.DECIDING
    # One more failure is the first in a row, not the third.
    again.fail(again.ask()[0], "stalled")
    run(again)
    assert again.state.answer is Answer.DECIDED
    # All of it stands in the journal.
    last = explorer(**usual)
    last.go_on()
    assert last.state == again.state
    assert len(last.history.failures) == 3


def test_a_larger_budget_goes_on_with_a_journal(tmp_path):
    """As if it had been the larger one from the beginning."""
    path, usual = tmp_path / "run.jsonl", {"width_deg": 0.5}
    run(explorer(journal=path, budget=3, **usual))
    more = explorer(journal=path, budget=5, **usual)
    assert len(run(more)) == 2
    at_once = explorer(budget=5, **usual)
    run(at_once)
    assert more.table.frame.equals(at_once.table.frame)
    assert more.state == at_once.state


@pytest.mark.parametrize(
    ("cut", "step"),
    [
        (0, 4),
        pytest.param(0, 1, marks=pytest.mark.slow),
        pytest.param(5, 1, marks=pytest.mark.slow),
    ],
)
def test_killed_at_any_line_the_same_pushes_follow(tmp_path, cut, step):
    """Every journal that a kill can leave leads to the end of the one not killed."""
    path = tmp_path / "whole.jsonl"
    limits = Limits(reference_every=3)
    own = explorer(journal=path, limits=limits, width_deg=12.0)
    run(own)
    lines = path.read_bytes().splitlines(keepends=True)
    for n in range(1, len(lines), step):
        part = tmp_path / "part.jsonl"
        part.write_bytes(b"".join(lines[:n]) + lines[n][:cut])
        again = explorer(journal=part, limits=limits, width_deg=12.0)
        run(again)
        told, expected = (
            [e for e in map(json.loads, p.read_text().splitlines()) if e["event"] == k]
            for p, k in ((part, "told"), (path, "told"))
        )
        strip = [{k: v for k, v in e.items() if k != "number"} for e in told]
        assert strip == [
            {k: v for k, v in e.items() if k != "number"} for e in expected
        ]
        assert again.state == own.state
        was_moving = json.loads(lines[n - 1])["event"] == "asked"
        failed = [f.reason for f in again.history.failures]
        assert failed == (["interrupted"] if was_moving else [])


def test_a_slip_stays_seen_whenever_the_process_is_killed(tmp_path):
    """Also where its flags are on the disk: those hide it from who looks again."""
    path, part = tmp_path / "whole.jsonl", tmp_path / "part.jsonl"
    usual = {"width_deg": 1.0, "limits": Limits(reference_every=4)}
    own = explorer(journal=path, **usual)
    run(own, n=4)
    run(own, n=1, params=SOFTER)
    assert "the object has moved" in own.state.sentence
    lines = path.read_bytes().splitlines(keepends=True)
    words = [json.loads(line)["event"] for line in lines]
    last = len(words) - words[::-1].index("told")
    assert "moved" in words[last:]
    for n in range(last, len(lines)):
        part.write_bytes(b"".join(lines[:n]))
        again = explorer(journal=part, **usual)
        assert again.ask() == ()
        assert again.state == own.state
        assert again.history.told == own.history.told


def test_interrupted_while_it_thinks_the_same_object_goes_on():
    """As a cell of a notebook that is stopped and run again."""
    at_once = explorer()
    run(at_once)
    interrupted = []

    def source(*asked):
        if asked[0] is not None and asked[2] not in interrupted:
            interrupted.append(asked[2])
            raise KeyboardInterrupt
        return importance(*asked)

    own = explorer(source=source)
    for _ in range(len(at_once.history.told)):
        with contextlib.suppress(KeyboardInterrupt):
            run(own)
    assert len(interrupted) > 2
    assert own.history == at_once.history


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"width_deg": 3.0}, "width_deg = 9.0, not 3.0"),
        ({"ask": "alpha_star"}, r'ask = \["theta_c"\], not \["alpha_star"\]'),
        ({"prob": 0.5}, "prob = 0.9, not 0.5"),
        ({"seed": 1}, "seed = 0, not 1"),
        ({"sigma": 1.0}, f"sigma = {SIGMA}, not 1.0"),
        ({"sigma": None}, f"sigma = {SIGMA}, not null"),
        ({"channels": ("height",)}, r'channels = .*, not \["height"\]'),
        ({"unit": "kpa"}, 'unit = "n", not "kpa"'),
        ({"limits": Limits(force=3.0)}, r"limits\.force = null, not 3.0"),
    ],
)
def test_a_journal_of_another_question_is_refused(tmp_path, changes, said):
    path = tmp_path / "run.jsonl"
    explorer(journal=path)
    with pytest.raises(ConfigError, match=f"was begun with {said};"):
        explorer(journal=path, **changes)
    # It is left as it was.
    explorer(journal=path)


def test_a_journal_of_other_settings_is_refused_by_their_keys(tmp_path):
    path, settings = tmp_path / "run.jsonl", {"sigma": SIGMA, "channels": COMPONENTS}
    Explorer({"push": {"length_mm": 5.0}}, journal=path, **settings)
    with pytest.raises(ConfigError, match=r"config.push.length_mm = 5.0, not 4.0"):
        Explorer({"push": {"length_mm": 4.0}}, journal=path, **settings)


def test_a_damaged_journal_is_refused(tmp_path):
    path = tmp_path / "run.jsonl"
    explorer(journal=path).ask()
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], "{no json", *lines[1:]]) + "\n")
    with pytest.raises(DataError, match="line 2"):
        explorer(journal=path)


@pytest.mark.parametrize(
    ("line", "damaged", "what"),
    [
        (1, '{"event": "told"}', "no start"),
        (2, "[1, 2]", "no event"),
        (2, '{"word": "asked"}', "no event"),
        (2, '{"event": "aksed"}', "no event is called 'aksed'"),
        (2, '{"event": "drawn"}', "'n' is missing"),
        (2, '{"event": "drawn", "n": "two"}', "integer"),
        (2, '{"event": "attached", "rows": []}', "'reference_alpha' is missing"),
        (3, '{"event": "told", "theta": 0.5}', "alpha: Field required"),
        (3, '{"event": "told", "theta": 0.5, "alpha": "x"}', "alpha: Input should be"),
        (3, TOLD % '{"force": 1.0}', "numbers for force were told"),
        (3, TOLD % '{"height": NaN}', "height = nan is no finite number"),
        (3, "\udcff", "utf-8"),
    ],
)
def test_a_damaged_event_is_named_by_its_line(tmp_path, line, damaged, what):
    path = tmp_path / "run.jsonl"
    own = explorer(journal=path, channels=("height",))
    (push,) = own.ask()
    own.tell(push.theta, push.alpha, 1.0)
    lines = path.read_text().splitlines()
    lines[line - 1] = damaged
    path.write_bytes("\n".join([*lines, ""]).encode(errors="surrogateescape"))
    with pytest.raises(DataError) as refused:
        explorer(journal=path, channels=("height",))
    said = str(refused.value)
    assert said.startswith(f"{path}, line {line}: ")
    assert what in said
    assert said.endswith("keep the lines before it, restore it, or begin another")


def test_a_journal_of_any_letters_is_read_again(tmp_path):
    """Some separate lines for Python and for no editor."""
    path = tmp_path / "run.jsonl"
    own = explorer(journal=path)
    own.fail(own.ask()[0], "stalled\u2028again")
    assert explorer(journal=path).history == own.history
