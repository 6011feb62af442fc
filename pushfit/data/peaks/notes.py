"""What there is to tell about pushes that were taken from a recording.

Excluded: refusals for want of pushes (`pushfit.data.peaks.chosen_humps`).
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pushfit.config.inputs import PeakSettings
from pushfit.data.plans.pairing import Paired
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.tables.rules import EXCLUDING_FLAGS
from pushfit.data.text.faults import listed
from pushfit.data.units import Unit
from pushfit.errors import stated

# Tops that differ by less than this share of a height are one level; two pushes have
# one by chance. Not tuned.
_ONE_LEVEL, _FEW = 0.05, 3


def extraction_notes(
    paired: Paired, frame: pd.DataFrame, settings: PeakSettings, *, unit: Unit
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Tell what was taken for granted, and what the user should not overlook.

    Returns:
        Notes, and cautions: what was left out, assumed to be missing, or mixed.
    """
    definition, mixed = _definitions(frame)
    notes = [definition] if definition else []
    notes += paired.notes()
    flagged = _flagged(frame)
    notes += [f"{flag}: push {pushes}" for flag, pushes in flagged.items()]
    cautions = [
        *_limits(flagged.get("saturated"), settings),
        *mixed,
        *_rests(paired, frame),
        *_on_shelves(paired, frame),
        *_upside_down(frame, settings, unit),
        *_left_out(paired, unit),
        *paired.cautions(unit),
    ]
    return tuple(notes), tuple(cautions)


def _definitions(frame: pd.DataFrame) -> tuple[str, list[str]]:
    """What the heights are; a caution where those for a fit are not all the same."""
    rows = zip(frame["definition"], frame["flags"], strict=True)
    stated = [
        word
        for word, flags in rows
        if word and EXCLUDING_FLAGS.isdisjoint(flags.split(";"))
    ]
    n_held = stated.count("plateau")
    if not stated:
        return "", []
    if n_held in (0, len(stated)):
        return f"heights are those of the {stated[0]} of each push", []
    return "", [
        f"mixed definitions: {n_held} of {len(stated)} heights are plateaus, the "
        'others apexes; state peaks.height = "apex" or "plateau" before they are '
        "compared in a fit"
    ]


def _rests(paired: Paired, frame: pd.DataFrame) -> list[str]:
    """Pushes measured from before a level that they hold, where others are not."""
    shown = [k for k, is_missing in enumerate(paired.is_missing) if not is_missing]
    held = [k for k in shown if paired.chosen[k].contact]
    if len(held) in (0, len(shown)):
        return []
    shares = [100 * paired.chosen[k].contact for k in held]
    least, most = f"{min(shares):.0f}", f"{max(shares):.0f}"
    level = most if least == most else f"{least} to {most}"
    pushes = listed([str(frame["push"].iloc[k]) for k in held])
    return [
        f"mixed rests: a level of {level} % of the height "
        f"is held on the way up by push {pushes}, measured from the rest before "
        "it; the others are measured from the level that they rise from. "
        "If a finger touches first, let it touch as lightly before all pushes, or "
        f"leave these out, as by {stated(exclude=[paired.chosen[held[0]].window])}"
    ]


def _on_shelves(paired: Paired, frame: pd.DataFrame) -> list[str]:
    """Pushes that may stand on a rest level that has stepped up and down."""
    held = [
        k
        for k, own in enumerate(paired.chosen)
        if own.shelf and not paired.is_missing[k]
    ]
    if not held:
        return []
    shares = listed([f"{100 * paired.chosen[k].shelf:.0f} %" for k in held])
    pushes = listed([str(frame["push"].iloc[k]) for k in held])
    return [
        f"a level of {shares} of the height is held before and after the top of push "
        f"{pushes}; if the grip changed there and back, the push is what rises from "
        "that level, and is read so between `begin` and `end` within it; or leave it "
        f"out, as by {stated(exclude=[paired.chosen[held[0]].window])}"
    ]


def _upside_down(frame: pd.DataFrame, settings: PeakSettings, unit: Unit) -> list[str]:
    """Pushes of one channel that all rise to the level that the recording ends at."""
    height, baseline = (f"{name}_{unit.canonical}" for name in ("height", "baseline"))
    if settings.signed or baseline not in frame or len(frame) < _FEW:
        return []
    own = frame.sort_values("t_peak_s")
    turned = -1.0 if settings.invert else 1.0
    tops = own[height] + turned * own[baseline]
    is_cut = own["flags"].str.contains("clipped")
    if not (is_cut.iloc[0] and is_cut.iloc[-1]):
        return []
    if np.ptp(tops) > _ONE_LEVEL * own[height].median():
        return []
    way = "up: leave out `invert`" if settings.invert else "down: state `invert=True`"
    return [
        "all pushes rise to the level that the recording begins and ends at; if that "
        f"is its rest, they go {way}"
    ]


def brushes_left_out(paired: Paired, unit: Unit) -> list[str]:
    """Humps that may be no pushes, and are none; nothing where there are none.

    One at the moment of a missing push is where that is measured, and no push either.
    """
    rows = zip(paired.chosen, paired.is_missing, strict=True)
    pushes = [extent for extent, is_missing in rows if not is_missing]
    own = [e for e in paired.found.extents if e.is_brush and e not in pushes]
    if not own:
        return []
    return [
        "humps far smaller than the pushes, or far briefer than one beside them, "
        f"are left out: {_times(own, unit)}; take one in by "
        f"{stated(include=[own[0].window])}"
    ]


def _left_out(paired: Paired, unit: Unit) -> list[str]:
    """Brushes, dips and excluded humps that are no rows."""
    found = paired.found
    notes = brushes_left_out(paired, unit)
    if found.jerks:
        notes.append(
            "jerks far briefer than a push are left out, with their samples: "
            f"{_times(found.jerks, unit)}; take one in by "
            f"{stated(include=[found.jerks[0].window])}"
        )
    if found.notches:
        times = ", ".join(f"{when:.2f} s" for when in found.notches)
        notes.append(
            "readings far below all around them, for less than a push lasts, are left "
            f"out: at {times}"
        )
    if found.idle:
        windows = ", ".join(f"{first:.15g}:{last:.15g}" for first, last in found.idle)
        notes.append(
            f"no hump is at its highest, or has its t_peak_s, in {windows} s, which is "
            "excluded or included"
        )
    if found.excluded:
        notes.append(f"left out as told: {_times(found.excluded, unit)}")
    if found.dips:
        notes.append(
            f"the signal falls below rest: {_times(found.dips, unit)}; state "
            "`signed=True` if these are pushes as well"
        )
    return notes


def _times(extents: Sequence[Extent], unit: Unit) -> str:
    """When humps are, and how high: all of them, for no table has what is left out."""
    humps = [f"{e.t_peak:.2f} s ({unit.shown(e.height)})" for e in extents]
    return f"at {', '.join(humps)}"


def _flagged(frame: pd.DataFrame) -> dict[str, str]:
    """The pushes that have each flag."""
    cells = [set(filter(None, cell.split(";"))) for cell in frame["flags"]]
    return {
        flag: listed(
            [str(p) for p, own in zip(frame["push"], cells, strict=True) if flag in own]
        )
        for flag in sorted(set().union(*cells))
    }


def _limits(pushes: str | None, settings: PeakSettings) -> list[str]:
    """Where a sensor is taken to end that nobody has stated."""
    if pushes is None or settings.limit is not None:
        return []
    return [
        f"readings pile up at the top of push {pushes}, flagged saturated and left out "
        "of a fit; if the sensor does not end there, state `limit`"
    ]
