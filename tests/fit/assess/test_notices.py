"""What a table says before anything is fitted."""

import pytest

from pushfit.fit.assess.notices import table_notices
from tests.fit.tables import case_table, config
from tests.problems import CASES


@pytest.mark.parametrize("is_mixed", [False, True])
def test_heights_of_two_definitions_in_one_fit_are_said(is_mixed):
    table = case_table(CASES["firm"], noise=0.02)
    definitions = ["apex"] * table.n_pushes
    if is_mixed:
        definitions[3] = "plateau"
    stated = type(table).from_frame(table.frame.assign(definition=definitions))
    codes = [notice.code for notice in table_notices(stated, config())]
    assert ("mixed_definitions" in codes) is is_mixed


def test_a_push_that_is_left_out_mixes_nothing():
    table = case_table(CASES["firm"], noise=0.02).with_flag([3], "clipped")
    definitions = ["apex"] * table.n_pushes
    definitions[3] = "plateau"
    stated = type(table).from_frame(table.frame.assign(definition=definitions))
    assert "mixed_definitions" not in {n.code for n in table_notices(stated, config())}
