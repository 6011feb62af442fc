"""NumPy files: arrays that have names, and tables whose columns have none.

Excluded: logs of text (`pushfit.data.text.foreign`), and what the columns mean
(`pushfit.data.recordings.roles`).
"""

import contextlib
from collections import Counter
from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.lib.npyio import NpzFile

from pushfit.data.text.faults import STATE_COLUMNS, listed, refuse, refuse_columns

Table = dict[str, np.ndarray]

_SAVE_COLUMNS = "as in np.savez(NAME, time_s=time, pressure_kpa=pressure)"
# Arrays whose lengths differ by a smaller share were to be columns of one table.
_ONE_TABLE = 0.1


def numpy_table(path: str, columns: Sequence[str]) -> tuple[Table, str]:
    """Columns of a NumPy file, and which kind of file it is.

    Args:
        columns: Names of the columns of a table without names.

    Raises:
        ConfigError: If names are stated for columns that have some.
        DataError: If it cannot be read, or holds no columns or several tables.
    """
    try:
        loaded = np.load(path, allow_pickle=False)
        if not isinstance(loaded, np.ndarray):
            with loaded:
                return _columns_of(loaded, columns, path=path)
    except (ValueError, OSError, EOFError) as error:
        raise refuse(
            "unreadable",
            f"is no NumPy file of numbers ({error}); copy it again, or save its arrays "
            "anew by np.savez, each of numbers alone",
            path=path,
        ) from error
    if loaded.dtype.names:
        refuse_columns(columns, loaded.dtype.names, path=path)
        table = {name: loaded[name].astype(float) for name in loaded.dtype.names}
    else:
        table = _named(np.atleast_2d(loaded.T).T, columns, path=path)
    return table, "NumPy .npy"


def _columns_of(
    arrays: NpzFile, columns: Sequence[str], *, path: str
) -> tuple[Table, str]:
    """Arrays of numbers of one length: the longest that two of them have.

    What is longer or shorter has another clock, or is no column but says something of
    them, and is named as left aside. So is a table, such as a calibration, unless it is
    all there is, or names are stated for its columns.
    """
    held = _numbers(arrays)
    is_table = {n: sum(k != 1 for k in a.shape) > 1 for n, a in held.items()}
    lone = {name: a.ravel() for name, a in held.items() if not is_table[name]}
    tables = {name: a for name, a in held.items() if is_table[name]}
    sizes = Counter(values.size for values in lone.values())
    length = max((n for n in sizes if n > 1 and sizes[n] > 1), default=0)
    named: Table = {}
    taken = None
    if tables and (columns or not length):
        taken, rows = _only(tables, path=path)
        named, length = _named(rows, columns, path=path, array=taken), len(rows)
    else:
        length = length or _longest(lone, path=path)
        if length == 0:
            raise refuse(
                "no_rows",
                "holds no array of numbers; save one for the time and one for each "
                f"signal, {_SAVE_COLUMNS}",
                path=path,
            )
        refuse_columns(columns, list(lone), path=path)
    own = {n: a for n, a in lone.items() if a.size == length and n not in named}
    aside = ", ".join(n for n in arrays.files if n != taken and n not in own)
    return {**own, **named}, f"NumPy .npz{f', left aside {aside}' if aside else ''}"


def _longest(lone: Table, *, path: str) -> int:
    """Length of the longest of some arrays, no two of which are as long.

    Raises:
        DataError: If one is nearly as long.
    """
    sizes = {name: array.size for name, array in lone.items()}
    length = max(sizes.values(), default=0)
    alike = [f"{n} ({k})" for n, k in sizes.items() if k > (1 - _ONE_TABLE) * length]
    if len(alike) > 1:
        raise refuse(
            "unequal_lengths",
            f"the arrays are of unequal length: {listed(alike)}; save as many samples "
            f"of each, {_SAVE_COLUMNS}",
            path=path,
        )
    return length


def _numbers(arrays: NpzFile) -> Table:
    """Arrays of numbers by name, also what are fields of another array."""
    held: Table = {}
    for name in arrays.files:
        # What is no array of numbers, such as a pickled setting, is no column.
        with contextlib.suppress(ValueError):
            own = arrays[name]
            fields = own.dtype.names
            parts = {field: own[field] for field in fields} if fields else {name: own}
            held |= {part: values.astype(float) for part, values in parts.items()}
    return held


def _only(tables: Table, *, path: str) -> tuple[str, np.ndarray]:
    """Name and rows of the table of a file.

    Raises:
        DataError: If there are several, or what there is has more than two dimensions.
    """
    if len(tables) == 1:
        ((name, rows),) = tables.items()
        if rows.ndim == 2:
            return name, rows
    sizes = [f"{n} ({' × '.join(map(str, a.shape))})" for n, a in tables.items()]
    raise refuse(
        "ambiguous_table",
        f"one table of rows and columns is looked for, there are: {listed(sizes)}; "
        "save it alone, or the columns that belong together by names of their own, "
        f"{_SAVE_COLUMNS}",
        path=path,
    )


def _named(
    rows: Shaped[np.ndarray, "n k"],
    columns: Sequence[str],
    *,
    path: str,
    array: str | None = None,
) -> Table:
    """Columns of a table by the names that are stated.

    Args:
        array: Name of the table among the arrays of its file.
    """
    names, n_columns = [name for name in columns if name != "..."], rows.shape[1]
    is_named = len(names) <= n_columns if "..." in columns else len(names) == n_columns
    if not names or not is_named:
        what = "holds" if array is None else f"array {array!r} holds"
        way = STATE_COLUMNS
        if names:
            way = f"named were {len(names)}; {way}"
        if len(names) == len(rows):
            way += "; if its rows are the columns, save it transposed, as table.T"
        raise refuse(
            "no_header", f"{what} {n_columns} columns without names; {way}", path=path
        )
    return {name: rows[:, k].astype(float) for k, name in enumerate(names)}
