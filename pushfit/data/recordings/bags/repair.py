"""What a bag lacks: message definitions, or its end.

Excluded: reading what is then whole (`pushfit.data.recordings.bags.bag`).
"""

import re
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from pushfit.data.text.faults import refuse
from pushfit.errors import ConfigError

_MAGIC = b"\x89MCAP0\r\n"
# Opcode, length and three zero fields: no summary, so readers scan the file itself.
_FOOTER = b"\x02" + struct.pack("<Q", 20) + bytes(20)
# Bytes copied at once: bags may be larger than the memory.
_COPIED = 1 << 22


def definition_files(folder: str) -> list[tuple[str, Path]]:
    """Message definitions as ROS packages keep them, by names as `package/msg/Name`."""
    found = []
    for file in sorted(Path(folder).rglob("*.msg")):
        package = file.resolve().parent
        if package.name == "msg":
            package = package.parent
        found.append((f"{package.name}/msg/{file.stem}", file))
    return found


def message_types(folder: str) -> dict[str, Any]:
    """Read message definitions as `definition_files` finds them.

    Raises:
        ConfigError: If there are none (`no_definitions`) or one is not a definition
            (`bad_definition`).
    """
    files = definition_files(folder)
    if not files:
        raise ConfigError(
            f"{folder}: no .msg file in it or below; name the folder of a ROS package, "
            "which holds msg/Name.msg",
            code="no_definitions",
        )
    parse = import_module("rosbags.typesys").get_types_from_msg
    types: dict[str, Any] = {}
    for name, file in files:
        try:
            types |= parse(file.read_text(encoding="utf-8"), name)
        except Exception as error:
            reason = re.sub(r"\s+", " ", str(error))
            raise ConfigError(
                f"{file}: is no message definition ({reason}); mend or remove it",
                code="bad_definition",
            ) from error
    return types


def is_whole_mcap(path: str) -> bool:
    """Tell whether a file is no `.mcap`, or one that its writer has closed."""
    if Path(path).is_dir():
        return True
    with open(path, "rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return True
        size = file.seek(0, 2)
        file.seek(max(0, size - len(_MAGIC)))
        return file.read() == _MAGIC


@contextmanager
def salvaged_mcap(path: str) -> Iterator[tuple[str, str]]:
    """Copy the whole records of a `.mcap` file that was cut short.

    Yields:
        Path of the copy, which exists as long as the context, and a note.

    Raises:
        DataError: If not even one record is whole (`bad_bag`).
    """
    with (
        open(path, "rb") as source,
        tempfile.NamedTemporaryFile(suffix=".mcap") as copy,
    ):
        size = source.seek(0, 2)
        end = source.seek(len(_MAGIC))
        while len(head := source.read(9)) == 9:
            # A footer would close the copy before what follows it.
            after = source.tell() + struct.unpack("<Q", head[1:])[0]
            if after > size or head[0] in (0x00, 0x02):
                break
            end = source.seek(after)
        if end == len(_MAGIC):
            raise refuse(
                "bad_bag", "nothing of the bag can be salvaged; record again", path=path
            )
        source.seek(0)
        for start in range(0, end, _COPIED):
            copy.write(source.read(min(_COPIED, end - start)))
        copy.write(_FOOTER + _MAGIC)
        copy.flush()
        yield copy.name, f"salvaged {end} of {size} bytes: the file was cut short"
