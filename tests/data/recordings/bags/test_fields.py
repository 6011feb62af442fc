"""What is said of the fields of a bag whose messages are of no known type."""

from types import SimpleNamespace

import numpy as np
import pytest

from pushfit.data.recordings.bags.fields import (
    NOT_THERE,
    Field,
    bad_field,
    known_fields,
    mapped_fields,
    number_at,
    numbers_in,
)
from pushfit.data.units import UNITS
from pushfit.errors import DataError

JOINTS = SimpleNamespace(name=["thumb", "index"], effort=np.ones(2), velocity=[])
MESSAGES = {
    "array": SimpleNamespace(
        header=SimpleNamespace(seq=3), layout=SimpleNamespace(size=1), data=np.ones(3)
    ),
    "text": SimpleNamespace(data="[7, -1.5 N, 3]", serial="bt_12"),
    "taxel": SimpleNamespace(values=[SimpleNamespace(pac=np.ones(22), serial="x1")]),
    "joints": JOINTS,
    "words": SimpleNamespace(data="no contact", is_on=True),
}
LISTED = {
    "array": ["header.seq", "layout.size", "data[0..2]"],
    "text": ["data[0..2]"],
    "taxel": ["values[0].pac[0..21]"],
    "joints": ["effort[0..1]"],
    "words": [],
}


@pytest.mark.parametrize("name", MESSAGES)
def test_the_numbers_of_a_message_are_listed_with_their_lengths(name):
    paths = numbers_in(MESSAGES[name], name)
    assert paths == [f"{name}.{path}" for path in LISTED[name]]


def test_what_a_bag_holds_is_listed_with_an_example_that_can_be_typed():
    kind = SimpleNamespace(msgtype="std_msgs/msg/Float64MultiArray")
    reader = SimpleNamespace(topics={"array": kind, "text": kind})
    with pytest.raises(DataError) as caught:
        known_fields("a.bag", reader, MESSAGES.get)
    message = str(caught.value)
    assert "`mapping={'pressure': 'text.data[0]'}" in message
    assert message.endswith(
        "first messages are array.layout.size, array.data[0..2], text.data[0..2], "
        "where [0..n] is an index from 0 to n"
    )


@pytest.mark.parametrize(
    ("key", "topic", "newtons"),
    [("f", "/amp_mv", 0.5), ("f_mv", "/amp", 0.5), ("f", "/amp", 500.0)],
)
def test_a_gain_is_applied_to_the_volts_of_a_field(key, topic, newtons):
    reader = SimpleNamespace(topics={topic: None})
    (field,) = mapped_fields(
        "a.bag", {key: f"{topic}.data"}, units={key: "500mN/V"}, reader=reader
    )
    assert field.unit.to_canonical(np.array([1000.0])) == [newtons]


@pytest.mark.parametrize(
    ("name", "path", "said"),
    [
        (
            "array",
            "data 7",
            "data[7]; data has 3 numbers, [0] to [2]; map one of these",
        ),
        ("array", "data", "data; data has 3 numbers, [0] to [2]; map one of these"),
        ("array", "size", "size; map what it holds: layout.size, data[0..2], where"),
        ("text", "data 3", "data[3]; data has 3 numbers, [0] to [2]; map one of these"),
        ("taxel", "values 1 pac 0", "values[1].pac[0]; values has 1 number, [0]; map"),
        ("taxel", "values 0 pac 22", "values[0].pac has 22 numbers, [0] to [21]; map"),
        ("joints", "effort ring", "map one of these, or a joint: thumb, index"),
        ("joints", "velocity 0", "velocity is empty in it; map another field"),
        ("words", "data 0", "data is empty in it; map another field"),
        ("words", "force", "force; map what it holds: no number"),
    ],
)
def test_a_number_that_is_not_there_is_refused_with_those_that_are(name, path, said):
    steps = tuple(path.split())
    with pytest.raises(NOT_THERE):
        number_at(MESSAGES[name], steps)
    item = Field(name="f", topic=name, path=steps, unit=UNITS["n"])
    error = bad_field("a.bag", item, message=MESSAGES[name], count=2)
    assert error.code == "missing_column"
    assert str(error).startswith(f"a.bag: message 2 of {name} has no number ")
    assert said in str(error)
