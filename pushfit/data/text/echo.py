"""What `rostopic echo` and `ros2 topic echo` print: messages between lines of dashes.

Numbers are named by the fields that lead to them, and elements of a list by their index
as in a bag: `bt_data[0].pdc_data`. Excluded: which messages make the columns of a table
(`pushfit.data.text.foreign`), and tables of `rostopic echo -p`
(`pushfit.data.text.dialects`).
"""

import re
from collections import Counter
from collections.abc import Iterator

from pushfit.data.text.faults import refuse
from pushfit.data.text.ros_logs import NUMBER, LogRecord

_LINE = re.compile(
    r"(?P<indent> *)(?P<dash>-(?:\s+|$))?(?:(?P<key>[A-Za-z_]\w*):\s*)?"
    r"(?P<value>.*?)\s*$"
)
_VALUE = re.compile(rf"(?:\[.*\]|{NUMBER})?")
_END = "---"


def is_echo(text: str) -> bool:
    """Whether a text begins with a message, and the message ends within."""
    first = _LINE.match(text.lstrip("-\n ").partition("\n")[0])
    is_field = first is not None and first["key"] and _VALUE.fullmatch(first["value"])
    return bool(is_field) and re.search(rf"^{_END}\s*$", text, re.M) is not None


def echo_records(path: str) -> list[LogRecord]:
    """Numbers of all messages that have some.

    Raises:
        DataError: If none has (`no_rows`).
    """
    messages = list(_messages(path))
    if not messages:
        raise refuse(
            "no_rows",
            "holds no message with a number; print the topic of the sensor, or record "
            "it as a bag",
            path=path,
        )
    return messages


def _messages(path: str) -> Iterator[LogRecord]:
    """Numbers of each message by their path."""
    message: LogRecord = {}
    above: list[tuple[int, str]] = []
    counts: Counter[str] = Counter()
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            if line.startswith(_END):
                if message:
                    yield message
                message, above, counts = {}, [], Counter()
                continue
            match = _LINE.match(line.rstrip("\n"))
            if match is None or not (match["dash"] or match["key"]):
                continue
            depth = len(match["indent"])
            if match["dash"]:
                # ROS 2 prints dashes right below the name of their list, ROS 1 deeper.
                above = [(d, step) for d, step in above if d <= depth]
                name = _joined(above)
                above.append((depth + 1, f"[{counts[name]}]"))
                counts[name] += 1
                depth += len(match["dash"])
            if match["key"]:
                above = [(d, step) for d, step in above if d < depth]
                above.append((depth, match["key"]))
            name, value = _joined(above), match["value"]
            if value.startswith("["):
                cells = re.findall(NUMBER, value)
                message |= {f"{name}[{k}]": float(c) for k, c in enumerate(cells)}
            elif re.fullmatch(NUMBER, value):
                message[name] = float(value)
    if message:
        yield message


def _joined(above: list[tuple[int, str]]) -> str:
    """The path of the fields and indices that a line is within."""
    steps = (step if step.startswith("[") else f".{step}" for _, step in above)
    return "".join(steps).removeprefix(".")
