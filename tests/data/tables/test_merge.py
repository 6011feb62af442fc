"""Tables of several recordings as one."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.data.tables.merge import merge_tables
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.text.files import Source
from pushfit.errors import DataError


def table(
    name: str, n: int, unit: str = "kpa", *, channels=("height",), sd=False
) -> PeakTable:
    made = PeakTable.from_arrays(
        theta=np.linspace(0.1, 1.0, n),
        alpha=np.zeros(n),
        heights={channel: np.arange(n) + 1.0 for channel in channels},
        unit=unit,
        sd={channel: np.ones(n) for channel in channels} if sd else None,
    )
    return replace(made, sources=(Source(path=name, sha256=f"{name}{n}", dialect="x"),))


def test_no_tables_are_refused():
    with pytest.raises(DataError, match="give one or more"):
        merge_tables([])


def test_pushes_keep_their_order_and_are_numbered_through():
    merged = merge_tables([table("a", 3), table("b", 2)])
    assert merged.frame["push"].tolist() == [1, 2, 3, 4, 5]
    np.testing.assert_array_equal(merged.heights("height"), [1, 2, 3, 1, 2])


def test_repeats_of_another_recording_are_others():
    """Each is a pass of its own, whatever its number in its recording."""
    sweeps = [
        PeakTable.from_arrays(
            theta=np.repeat([0.2, 0.4], n),
            alpha=np.zeros(2 * n),
            heights={"height": np.ones(2 * n)},
            unit="kpa",
        )
        for n in (2, 3)
    ]
    merged = merge_tables(sweeps)
    assert merged.frame["repeat"].tolist() == [1, 2, 1, 2, 3, 4, 5, 3, 4, 5]


def test_the_origin_of_every_push_is_kept():
    merged = merge_tables([table("a", 3), table("b", 2)])
    assert [source.path for source in merged.sources] == ["a", "b"]
    assert "pushes 4 to 5 are from b" in merged.notes


def test_one_table_stays_as_it_is():
    alone = table("a", 3)
    assert merge_tables([alone]) is alone


def test_units_are_not_mixed():
    with pytest.raises(DataError, match="height in counts and height in kpa"):
        merge_tables([table("a", 3), table("b", 2, unit="counts")])


def test_components_and_magnitudes_are_not_mixed():
    forces = table("b", 2, channels=("height_normal", "height_tangential"))
    with pytest.raises(DataError, match="height in kpa and height_normal, height_tan"):
        merge_tables([table("a", 3), forces])


def test_an_error_that_one_table_lacks_is_known_of_none():
    merged = merge_tables([table("a", 3), table("b", 2, sd=True)])
    assert merged.sd("height") is None


def test_a_recording_named_twice_is_refused():
    """Pushes that count twice make intervals narrower by a root of two."""
    with pytest.raises(DataError, match="b: has the same bytes as a") as caught:
        merge_tables([table("a", 3), replaced_path(table("a", 3), "b")])
    assert caught.value.code == "duplicate_recording"


def replaced_path(table: PeakTable, path: str) -> PeakTable:
    return replace(table, sources=(replace(table.sources[0], path=path),))
