"""Which columns a table of peak heights has, and what the cells of tables may hold.

Plans keep the rules for directions as well, by the same pandera schema. Excluded: how
columns are recognised and breaches reported
(`pushfit.data.tables.columns`), and judging heights against a model.
"""

import numpy as np
import pandas as pd

from pushfit.data.recordings.recognise import DIRECTION_COLUMNS
from pushfit.data.tables.columns import COMMON, Columns, Known, Origin, read_columns
from pushfit.data.text.faults import data_error, listed
from pushfit.data.units import UNITS, implausible_angles
from pushfit.errors import DataError, InputProblem

CHANNELS = ("height", "height_normal", "height_tangential")

FLAGS = {
    "saturated": "the sensor was at its limit, the height is a lower bound",
    "clipped": "the recording starts or ends inside the push",
    "gap": "samples are missing at the top or for a quarter of the push",
    "drift": "the baseline moved by more than 15 % of the height",
    "missing": "no hump at the planned moment, the height is what is there",
    "lost_contact": "the push lifted the finger off",
    "averaged": "its height is in the mean at the first push of its direction",
    "moved": "the object moved before it or after, and nobody knows which",
    "outlier": "the height is far from those of the same direction",
}

# What a height may be, see `pushfit.data.peaks.heights`.
DEFINITIONS = ("apex", "plateau")

# Heights under these flags are not what the model predicts; the other is an opinion.
EXCLUDING_FLAGS = frozenset(FLAGS) - {"outlier"}

# Other columns that tables of peak heights may have.
SIGNALS = (*(name for c in CHANNELS for name in (c, f"{c}_sd")), "baseline")
TIMES = ("t_start", "t_peak", "t_end")
TEXTS = ("definition", "flags")
KNOWN: Known = {
    **COMMON,
    **dict.fromkeys(SIGNALS, "signal"),
    **dict.fromkeys(TIMES, "time"),
    **dict.fromkeys(TEXTS, "bare"),
}

# Column that tells the pushes of several grasps apart.
GRASP = "grasp"


def canonical_frame(
    raw: pd.DataFrame, origin: Origin
) -> tuple[pd.DataFrame, str, Columns]:
    """Recognise, convert and check the columns of a table of peak heights.

    Args:
        raw: Columns as named by the user; cells are numbers or text.

    Returns:
        Frame with canonical columns and units, unit of its heights, and what was left
        out or filled in.

    Raises:
        DataError: A column is missing, doubtful, twice there or in a wrong unit, a
            cell breaks its rule, or the pushes are of several grasps; all breaches are
            in `problems`.
    """
    columns = read_columns(raw, KNOWN, origin, any_of=CHANNELS)
    _refuse_several_grasps(raw, columns, origin)
    frame, unit = columns.frame, columns.unit
    if unit is None:
        raise DataError(
            "a peak table needs heights; name their column with its unit, "
            "as in height_n",
            code="missing_column",
        )
    if "flags" not in frame:
        frame["flags"] = ""
    check_columns(columns, origin)
    names = [
        *("push", "theta_deg", "alpha_deg", "repeat"),
        *(f"{name}_{unit}" for name in SIGNALS),
        *(f"{name}_s" for name in TIMES),
        *TEXTS,
    ]
    ordered = frame.reindex(columns=[name for name in names if name in frame])
    return ordered, unit, columns


def grasp_names(raw: pd.DataFrame) -> pd.Series | None:
    """Grasp of every row, under the name of the column; None where there is none."""
    column = next((c for c in raw.columns if str(c).strip().lower() == GRASP), None)
    return None if column is None else raw[column].fillna("").astype(str).str.strip()


def _refuse_several_grasps(raw: pd.DataFrame, columns: Columns, origin: Origin) -> None:
    """Refuse pushes of several grasps, which have parameters of their own."""
    names = grasp_names(raw)
    if names is None or names.nunique() == 1:
        return
    rows = {
        str(name): f"{name or 'none'} ({origin.places(where)})"
        for name, where in names.groupby(names, sort=False).indices.items()
    }
    cure = "`pushfit batch` identifies each of them, else keep the rows of one"
    if "" in rows:
        cure = "give every row its grasp, or leave the column out"
    text = (
        f"names {len(rows)} grasps, each with parameters of its own: "
        f"{listed([*rows.values()])}; {cure}"
    )
    column, value = str(names.name), ", ".join(rows)
    raise data_error(
        [origin.problem("several_grasps", text, column=column, value=value)]
    )


def check_columns(columns: Columns, origin: Origin) -> None:
    """Check every cell of a peak table or a plan, and the angles together.

    Raises:
        DataError: Cells break their rules; all are in `problems`.
    """
    import pandera.pandas as pa  # noqa: PLC0415 - slow to load, needed only to check

    count = pa.Check.ge(1, error="count")
    finite, positive = pa.Check(np.isfinite, error="finite"), pa.Check.gt(0, error="sd")
    # By column, each with a key of the reasons below; others may hold empty cells.
    checks = {
        "push": [count],
        "repeat": [count],
        "theta_deg": [pa.Check.in_range(-90, 90, error="theta")],
        "alpha_deg": [pa.Check.in_range(-360, 360, error="alpha")],
        # Only plans have times, which order their pushes.
        "time_s": [finite, pa.Check(lambda t: ~t.duplicated(keep=False), error="time")],
        "definition": [pa.Check.isin([*DEFINITIONS, ""], error="definition")],
        "flags": [pa.Check(_are_flags, element_wise=True, error="flags")],
    }
    for channel in CHANNELS:
        checks[f"{channel}_{columns.unit}"] = [finite]
        checks[f"{channel}_sd_{columns.unit}"] = [positive, finite]
    schema = pa.DataFrameSchema(
        {
            name: pa.Column(
                None,
                checks.get(name, []),
                nullable=name not in checks,
                unique=name == "push",
            )
            for name in map(str, columns.frame.columns)
        }
    )
    try:
        schema.validate(columns.frame, lazy=True)
    except pa.errors.SchemaErrors as error:
        raise data_error(_in_words(error.failure_cases, columns, origin)) from error
    degrees = {
        stem: (columns.frame[f"{stem}_deg"].to_numpy(), UNITS["deg"])
        for stem in columns.in_degrees
    }
    implausible = implausible_angles(degrees, cure=_RENAMED)
    if implausible:
        alone = [s for s in degrees if implausible_angles({s: degrees[s]})]
        given = columns.in_degrees[[*alone, *degrees][0]]
        raise data_error(
            [origin.problem("implausible_angles", implausible, column=given, value="")]
        )


def _are_flags(text: str) -> bool:
    """Whether a cell holds known flag words only."""
    return all(word in FLAGS for word in text.split(";") if word)


# Tables have units in their headers alone.
_RENAMED = "name columns of radians theta_{0} and alpha_{0}".format
# By name of the check as pandera reports it: stable code, rule with remedy.
_REASONS = {
    "theta": (
        "theta_range",
        "is outside [-90, 90]; theta is the elevation out of the tangential plane; "
        "an angle from the surface normal is 90 minus it",
    ),
    "alpha": ("alpha_range", "is outside [-360, 360]; give the azimuth within a turn"),
    "finite": ("not_finite", "is not a finite number; fill the cell or remove the row"),
    "not_nullable": (
        "missing_value",
        "stands for an empty cell; fill it or remove the row",
    ),
    "sd": ("sd_range", "is no standard deviation; give a number above 0"),
    "count": ("count_range", "is below 1; number pushes and repeats from 1"),
    "time": (
        "duplicate_time",
        "is the time of two pushes; give each its own, or leave the column out",
    ),
    "field_uniqueness": ("duplicate_push", "stands for two pushes; number them apart"),
    "definition": (
        "unknown_definition",
        "is neither apex nor plateau; write one of them",
    ),
    "flags": (
        "unknown_flag",
        f"is no list of known flags; join by ';' those of {', '.join(FLAGS)}",
    ),
}


def _in_words(
    cases: pd.DataFrame, columns: Columns, origin: Origin
) -> list[InputProblem]:
    """Failures of a schema in the order of the rows."""
    problems = []
    for case in cases.sort_values("index", kind="stable").to_dict("records"):
        code, rule = _REASONS[str(case["check"])]
        value = case["failure_case"]
        shown = f"{value:g}" if isinstance(value, float) else repr(value)
        column = str(case["column"])
        stem = column.removesuffix("_deg")
        is_converted = stem in DIRECTION_COLUMNS and stem not in columns.in_degrees
        if is_converted and code.endswith("_range"):
            shown = f"{np.radians(value):g} rad = {shown}°"
            rule += f"; name a column of degrees {column}"
        problems.append(
            origin.problem(
                code,
                f"{shown} {rule}",
                row=int(case["index"]),
                column=columns.given.get(column, column),
                value=str(value),
            )
        )
    return problems
