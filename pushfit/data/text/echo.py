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
from pushfit.data.text.ros_logs import VALUE, LogRecord

_LINE = re.compile(
    r"(?P<indent> *)(?P<dash>-(?:\s+|$))?(?:(?P<key>[A-Za-z_]\w*):\s*)?"
    r"(?P<value>.*?)\s*$"
)
_VALUE = re.compile(rf"(?:\[.*\]|{VALUE})?")
_END = "---"
# Messages of one field that is printed alone.
_BARE = re.compile(rf"(?:{VALUE}\s*\n{_END}\s*\n){{2}}")
# What is printed before the first message.
_WARNED = re.compile(r"\A(?:WARNING: .*\n(?:Is /clock .*\n)?)+")


def is_echo(text: str) -> bool:
    """Whether a text begins with a message, and the message ends within."""
    text = _WARNED.sub("", text)
    if _BARE.match(text):
        return True
    first = _LINE.match(text.lstrip("-\n ").partition("\n")[0])
    is_field = first is not None and first["key"] and _VALUE.fullmatch(first["value"])
    return bool(is_field) and re.search(rf"^{_END}\s*$", text, re.M) is not None


def echo_records(path: str, *, bare: str = "value") -> list[LogRecord]:
    """What all messages hold.

    Args:
        bare: Name of what is printed without one.

    Raises:
        DataError: If none has (`no_rows`).
    """
    messages = list(_messages(path, bare))
    if not any(message.numbers for message in messages):
        raise refuse(
            "no_rows",
            "holds no message with a number; print the topic of the sensor, or record "
            "it as a bag",
            path=path,
        )
    return messages


def _messages(path: str, bare: str) -> Iterator[LogRecord]:
    """What each message holds, by the path that leads there."""
    message: LogRecord | None = None
    above: list[tuple[int, str]] = []
    counts: Counter[str] = Counter()
    with open(path, encoding="utf-8", errors="replace") as file:
        for place, line in enumerate(file, 1):
            if line.startswith(_END):
                if message is not None:
                    yield message
                message, above, counts = None, [], Counter()
                continue
            match = _LINE.match(line.rstrip("\n"))
            # A last line without its end may be cut inside a number.
            if match is None or not line.endswith("\n"):
                continue
            message = message or LogRecord(line=place, at=place)
            message.at = place
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
            _put(message, _joined(above) or bare, match["value"])
    if message is not None:
        yield message


def _put(message: LogRecord, name: str, value: str) -> None:
    """Put a value into a message, or all of a list."""
    if value.startswith("["):
        cells = value.strip("[]").split(",") if value != "[]" else ()
        for k, cell in enumerate(cells):
            message.put(f"{name}[{k}]", cell.strip())
    elif value:
        message.put(name, value)


def _joined(above: list[tuple[int, str]]) -> str:
    """The path of the fields and indices that a line is within."""
    steps = (step if step.startswith("[") else f".{step}" for _, step in above)
    return "".join(steps).removeprefix(".")
