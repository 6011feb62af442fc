"""What a table says of itself before anything is fitted, by a warning each.

Excluded: the order of its pushes (`pushfit.fit.checks.push_order`), and whether the
model describes the heights (`pushfit.fit.checks.model_checking`).
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float

from pushfit.config import GraspConfig
from pushfit.config.schema import GraspSection, PushSection
from pushfit.data.grasp import is_calibrated
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import counted
from pushfit.fit.checks.model_checking import LEVEL, MIN_TESTED, label
from pushfit.fit.checks.push_order import drift_in_repeats, slope_through_zero
from pushfit.fit.results import ResultWarning
from pushfit.parameters import PARAMETERS

# What cannot be right, however well the model describes the heights, by codes.
WRONG = {
    **dict.fromkeys(("equal_heights", "other_unit"), "the table"),
    "inverted_heights": "the sign of the heights",
    "preload_contradicted": "the preload that is stated, or taken,",
    "counted_twice": "the noise of a height that follows from its components",
}
# What a table cannot say of its pushes, though a column may be called so.
SETTINGS = {"grasp": GraspSection, "push": PushSection}
# Equal heights at the top, and by how many times they are more than any others.
AT_TOP, MORE = 4, 2
# Directions whose repeats agree to the digit by chance at most.
FEW_TWINS = 3
# Heights alike to this share, from elevations at which most contacts roll to some that
# are as much higher: sines differ by half of their mean [deg].
ALIKE, LOW = 0.1, 30.0
# A slip of a unit, as mN among N: about 1000 times the median of all heights, and how
# far beyond all others. These differ by a factor of 12 from 5° to 85°, as sines do,
# unless noise hides them [decades]. Fewer heights do not say which of them is wrong.
SLIP, NEARLY, APART, FEW_HEIGHTS = 3.0, 1.0, 1.5, 3
# Elevations within this are one: a robot that sweeps azimuths misses its own by less.
# Not tuned [deg].
SAME_ELEVATION = 1.0
# What a magnitude differs from that of its components, of its noise, if it was computed
# from them; a sensor of its own has noise of its own. And the least noise of a sensor,
# where nothing tells of it, as a share of the heights.
COMPUTED, LEAST_NOISE = 0.2, 1e-3
# Nearer to the surface or its normal a height may be small by itself [deg].
EDGE = 4.0


def table_warnings(table: PeakTable, config: GraspConfig) -> Iterator[ResultWarning]:
    """What the table and the configuration already say."""
    yield from settings_warnings(config, table.unit)
    preload = config.preload_in(table.unit)
    if preload != "estimate":
        yield from _counted_twice(table, preload)
    may_tip = preload != "estimate" and _may_tip(table, preload)
    for warning in faults_of(table):
        if not (may_tip and warning.code == "inverted_heights"):
            yield warning
    is_missing = any("missing" in flags for flags in table.flags)
    if config.peaks.use_missing and is_missing and not table.traces:
        yield ResultWarning(
            code="setting_ignored",
            text="peaks.use_missing comes too late for a table: missing pushes are "
            "taken in where heights are measured, by `pushfit peaks` with that setting",
        )


def _may_tip(table: PeakTable, preload: float) -> bool:
    """Whether heights may be negative, as of an object that tips over.

    Then a push takes some of the preload away, but no more than there is.
    """
    heights = [table.heights(c)[table.is_used] for c in table.channels]
    return bool(np.all(np.stack(heights) > -preload))


def _counted_twice(table: PeakTable, preload: float) -> Iterator[ResultWarning]:
    """Whether the magnitude was computed from the components beside it.

        height = sqrt((height_normal + F_0)² + height_tangential²) - F_0

    Whatever constant is subtracted, F_0 or a reading at rest.
    """
    components = ("height_normal", "height_tangential")
    rows = table.is_used
    if {"height", *components} - set(table.channels):
        return
    height, normal, tangential = (
        table.heights(name)[rows] for name in ("height", *components)
    )
    if height.size < FEW_HEIGHTS:
        return
    off = height - np.hypot(normal + preload, tangential)
    sd = table.sd("height")
    noise = table.pooled_sd("height")[0] if sd is None else np.median(sd[rows])
    if np.isnan(noise):
        noise = LEAST_NOISE * np.sqrt(np.mean(height**2))
    if np.std(off) < COMPUTED * noise:
        columns = [f"{name}_{table.unit}" for name in ("height", *components)]
        yield ResultWarning(
            code="counted_twice",
            text=f"{columns[0]} is the magnitude of {columns[1]} and {columns[2]} to "
            f"{np.std(off):.1g}, which has no noise of its own: fitted beside them it "
            f"counts twice; remove the column {columns[0]}",
        )


def settings_warnings(config: GraspConfig, unit: str) -> Iterator[ResultWarning]:
    """What the configuration says before a push is made.

    Args:
        unit: Unit of the heights.
    """
    if not config.push.length_known:
        yield ResultWarning(
            code="push_length_unknown",
            text="the push length was not controlled or not stated, so stiffness is "
            "not quoted; θ_c and α* assume that all pushes were equally long, and "
            "unequal pushes make them wrong",
        )
    stiff = [n for n, _ in config.parameters.items() if PARAMETERS[n].is_stiffness]
    if stiff and not is_calibrated(config, unit):
        yield ResultWarning(
            code="sensor_stiffness",
            text=f"{', '.join(stiff)} in [parameters] count in {unit} for newtons, as "
            f"the heights are in {unit} and [sensor] does not say what that is in "
            f"newtons: state n_per_{unit.removesuffix('s')} there if they are SI",
        )
    if config.grasp.preload[1] is None:
        yield ResultWarning(
            code="preload_unknown",
            text="no preload is stated, and 0 was taken; one that is there makes C_rr "
            "and θ_c wrong, and the model can describe the heights as well: set "
            f"grasp.preload_{unit}, to 0 where there is none, or to "
            '"estimate"',
        )


def faults_of(table: PeakTable) -> Iterator[ResultWarning]:
    """What the table says by itself."""
    excluded = np.flatnonzero(~table.is_used)
    if excluded.size:
        names = "; ".join(
            f"{label(table, int(i))}: {', '.join(sorted(table.flags[i]))}"
            for i in excluded
        )
        yield ResultWarning(
            code="pushes_excluded", text=f"left out of the fit: {names}"
        )
    yield from ignored_columns(table)
    yield from _equal_heights(table)
    yield from _inverted(table)
    for row, words in unit_slips(table).items():
        yield ResultWarning(
            code="other_unit",
            text=f"{label(table, row)}: {words}; correct it, or leave the push out",
        )
    yield from _at_limit(table)
    yield from _copied_rows(table)
    yield from drift_in_repeats(table)
    yield from _few_elevations(table)
    if "definition" in table.frame:
        definitions = set(table.frame["definition"][table.is_used]) - {""}
        if len(definitions) > 1:
            yield ResultWarning(
                code="mixed_definitions",
                text="some heights were read at the apex of a push, others at its "
                "plateau, and one push has two heights by the two; set [peaks] height "
                "to the one that all should have",
            )


def _few_elevations(table: PeakTable) -> Iterator[ResultWarning]:
    """Fewer elevations than show where θ_c is, which miss their own by a little."""
    degrees = np.unique(np.degrees(table.theta[table.is_used]))
    distinct: list[float] = []
    for one in degrees.tolist():
        if not distinct or one - distinct[-1] > SAME_ELEVATION:
            distinct.append(one)
    if len(distinct) > 2:
        return
    text = f"pushes have only {counted(len(distinct), 'distinct elevation')}"
    if degrees.size > len(distinct):
        text += f", as all are within {degrees[0]:.3g}° to {degrees[-1]:.3g}°"
    yield ResultWarning(
        code="few_elevations",
        text=f"{text}; the critical angle needs several on both sides of it",
    )


def ignored_columns(table: PeakTable) -> Iterator[ResultWarning]:
    """Columns of the file that say what only settings can."""
    stated = {
        name: f"{section}.{key}"
        for name in table.left_out
        for section, of in SETTINGS.items()
        if (key := name.strip().lower()) in of.model_fields
    }
    for name, key in stated.items():
        yield ResultWarning(
            code="column_ignored",
            text=f"the column {name} is not used: {key} in the settings says it of all "
            "pushes, and those of another value are another table",
        )


def _equal_heights(table: PeakTable) -> Iterator[ResultWarning]:
    """Whether a channel reads the same, or nearly, whatever the direction."""
    rows = np.flatnonzero(table.is_used)
    if rows.size < MIN_TESTED or np.unique(table.groups[rows]).size < 2:
        return
    slopes = np.degrees(np.abs(table.theta[rows]))
    low, high = np.min(slopes), np.max(slopes)
    for channel in table.channels:
        heights = table.heights(channel)[rows]
        column = f"{channel}_{table.unit}"
        mean, sd = np.mean(heights), np.std(heights)
        if np.ptp(heights) == 0:
            yield ResultWarning(
                code="equal_heights",
                text=f"{column} is {heights[0]:g} in all {rows.size} "
                "pushes, whatever the direction; look whether the sensor was "
                "connected and not saturated, and whether the column is the right one",
            )
        elif sd < ALIKE * abs(mean) and low <= LOW and high - low >= LOW:
            yield ResultWarning(
                code="alike_heights",
                text=f"{column} is {mean:.3g} ± {sd:.1g} in all directions, from θ = "
                f"{low:.3g}° to {high:.3g}°, where a contact that rolls resists by "
                "sin θ; pushes that end at a force, or a sensor that shows the grip, "
                "do the same and tell nothing of θ_c: look whether all pushes were "
                "equally long, and what the column is",
            )


def _inverted(table: PeakTable) -> Iterator[ResultWarning]:
    """Whether pushes into the surface lower what they raise by any mechanics.

    Least squares of heights on sin θ alone: noise, or a few negative heights beside
    others, give no such slope.
    """
    rows = np.flatnonzero(table.is_used & (table.theta > 0))
    along = np.sin(table.theta[rows])
    for channel in sorted({"height", "height_normal"} & set(table.channels)):
        heights = table.heights(channel)[rows]
        p_value, slope = slope_through_zero(heights, along, rows.size - 1)
        if slope < 0 and p_value < LEVEL:
            cure = "`invert=True`"
            if channel == "height_normal":
                cure = "the other sign in [peaks] normal"
            yield ResultWarning(
                code="inverted_heights",
                text=f"{np.sum(heights < 0)} of {rows.size} pushes into the surface "
                f"(θ > 0) have a negative {channel}_{table.unit}, and any grasp that "
                "does not tip over resists them by a positive one; turn the sign of "
                f"the column, or take heights again with {cure}",
            )


def unit_slips(table: PeakTable) -> dict[int, str]:
    """Pushes that look as if they were told in another unit than the others.

    One height that is too large is enough. One that is too small may be noise, so all
    of a push have to be.

    Returns:
        What their heights are beside the others, by row of the table.
    """
    rows = np.flatnonzero(table.is_used)
    if rows.size < FEW_HEIGHTS:
        return {}
    heights = np.stack([table.heights(channel)[rows] for channel in table.channels])
    with np.errstate(divide="ignore", invalid="ignore"):
        typical = np.median(np.abs(heights), axis=1, keepdims=True)
        size = np.log10(np.abs(heights) / typical)
    large, small = (np.stack([_is_slip(row) for row in s * size]) for s in (1, -1))
    # Of both signs they pass through 0, and no push may be there by itself.
    has_one_sign = np.ptp(np.sign(heights), axis=1, keepdims=True) == 0
    is_inside = np.abs(np.degrees(np.abs(table.theta[rows])) - 45) < 45 - EDGE
    small &= np.all(small & has_one_sign & is_inside, axis=0)
    words = {
        int(rows[i]): f"{table.channels[c]}_{table.unit} = {heights[c, i]:g} is about "
        f"1000 times too {'large' if large[c, i] else 'small'} beside the others, as "
        "if in another unit"
        for c, i in np.argwhere(large | small)[::-1].tolist()
    }
    return dict(sorted(words.items()))


def _is_slip(size: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Which sizes are those of a slip, if they are apart from all others.

    Args:
        size: Heights over their median [decades].
    """
    is_slip = np.abs(size - SLIP) < NEARLY
    rest = np.max(size[~is_slip], initial=-np.inf)
    return is_slip & (np.min(size[is_slip], initial=np.inf) > rest + APART)


def _at_limit(table: PeakTable) -> Iterator[ResultWarning]:
    """Whether heights stop at a largest one, as no others are equal."""
    for channel in table.channels:
        values, counts = np.unique(
            table.heights(channel)[table.is_used], return_counts=True
        )
        others = np.max(counts[:-1], initial=0)
        if values.size > 1 and counts[-1] >= max(AT_TOP, MORE * others + 1):
            yield ResultWarning(
                code="heights_at_limit",
                text=f"{counts[-1]} heights have the largest {channel}_{table.unit}, "
                f"{values[-1]:g}, as at the limit of a sensor; if it is, flag these "
                "pushes saturated in the column flags",
            )


def _copied_rows(table: PeakTable) -> Iterator[ResultWarning]:
    """Whether all repeats of a direction have a twin, of the same heights."""
    rows = np.flatnonzero(table.is_used)
    _, inverse, counts = np.unique(
        table.groups[rows], return_inverse=True, return_counts=True
    )
    rows = rows[counts[inverse] > 1]
    heights = np.stack([table.heights(channel)[rows] for channel in table.channels])
    keys = np.vstack([table.groups[rows], heights])
    found, counts = np.unique(keys, axis=1, return_counts=True)
    differ = np.unique(found[1:], axis=1).shape[1] > 1
    if differ and found.shape[1] >= FEW_TWINS and np.min(counts) > 1:
        yield ResultWarning(
            code="copied_rows",
            text="every push of a direction that was pushed again has another one with "
            "the same heights, to the last digit; each counts as a measurement of its "
            "own, so leave out what was copied",
        )
