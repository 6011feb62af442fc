"""Units at the border: column suffixes, their canonical units, plausibility.

A column says its unit by its suffix (`pressure_kpa`, `time_ms`) or in brackets
(`Force (N)`). Inside, time is in seconds, angles in radians, lengths in metres, and a
signal keeps its own canonical unit (`n`, `kpa`, `counts`, `au`). Excluded: guesses. A
name without a unit has none, and an implausible number is reported, never rescaled.
"""

import math
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from pushfit.config.inputs import CalibrationSection
from pushfit.errors import ConfigError, did_you_mean

Dimension = Literal["signal", "time", "angle", "length"]
# Angles are stated as round numbers of degrees; so many digits survive the way to
# radians and back.
DECIMALS = 9
# Factors that are equal on paper differ by their rounding alone.
_SAME = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One unit that a column may be in.

    The canonical value is `value * times / per`. Two numbers, because 1e9 is exact in
    binary and 1e-9 is not: dividing keeps nanoseconds correctly rounded.

    Args:
        name: Suffix, lower case.
        quantity: What is measured.
        canonical: Unit used inside.
        times: Numerator of the conversion.
        per: Denominator of the conversion.
        volts: Volts that the values are in, as `mv`; empty where the unit is no gain.
    """

    name: str
    quantity: Dimension
    canonical: str
    times: float = 1.0
    per: float = 1.0
    volts: str = ""

    def to_canonical(self, values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Convert values in this unit to the canonical one."""
        if self.times != 1.0:
            values = values * self.times
        return values / self.per if self.per != 1.0 else values

    def shown(self, value: float, *, n_digits: int = 3) -> str:
        """A canonical value in words, in this unit.

        >>> UNITS["pa"].shown(1.95432)
        '1950 pa'
        """
        digits = f"{value * self.per / self.times:.{n_digits}g}"
        return f"{float(digits):g} {self.name}"

    def of_volts(self, volts: str) -> "Unit":
        """The same gain for values in other volts; itself where it is no gain.

        >>> unit = find_unit("500 mN/V").of_volts("mv")
        >>> unit.to_canonical(np.array([1000.0])).tolist()
        [0.5]
        """
        if self.volts in ("", volts):
            return self
        times, per = self.times * _NANOVOLTS[volts], self.per * _NANOVOLTS[self.volts]
        return replace(self, times=times, per=per, volts=volts)

    def equals(self, other: "Unit") -> bool:
        """Whether values are the same in both, as in 500 mN/V and 0.5 N/V."""
        own, its = self.times / self.per, other.times / other.per
        is_alike = (self.quantity, self.canonical) == (other.quantity, other.canonical)
        return is_alike and math.isclose(own, its, rel_tol=_SAME)


UNITS: dict[str, Unit] = {
    unit.name: unit
    for unit in (
        Unit(name="n", quantity="signal", canonical="n"),
        Unit(name="mn", quantity="signal", canonical="n", per=1e3),
        Unit(name="un", quantity="signal", canonical="n", per=1e6),
        Unit(name="kpa", quantity="signal", canonical="kpa"),
        Unit(name="pa", quantity="signal", canonical="kpa", per=1e3),
        Unit(name="counts", quantity="signal", canonical="counts"),
        Unit(name="au", quantity="signal", canonical="au"),
        Unit(name="s", quantity="time", canonical="s"),
        Unit(name="ms", quantity="time", canonical="s", per=1e3),
        Unit(name="us", quantity="time", canonical="s", per=1e6),
        Unit(name="ns", quantity="time", canonical="s", per=1e9),
        Unit(name="min", quantity="time", canonical="s", times=60.0),
        Unit(name="rad", quantity="angle", canonical="rad"),
        Unit(name="deg", quantity="angle", canonical="rad", times=np.pi, per=180.0),
        Unit(name="m", quantity="length", canonical="m"),
        Unit(name="mm", quantity="length", canonical="m", per=1e3),
    )
}

# Two letters look like the micro sign.
_MICRO = str.maketrans("µμ", "uu")
_NANOVOLTS = {"nv": 1.0, "uv": 1e3, "mv": 1e6, "v": 1e9, "kv": 1e12}
# Volts of an amplifier with its gain, as `500 mN/V` or `N/mV`.
_GAIN = re.compile(
    r"(?P<gain>[+-]?\d*\.?\d+(?:e[+-]?\d+)?)?\s*(?P<unit>[a-z]+)/(?P<volts>[numk]?v)"
)
# Volts anywhere in a name, but for those of a gain.
_IN_VOLTS = re.compile(
    r"(?<![a-z0-9/])(?P<prefix>milli|micro|kilo|[numk]?)v(olts?)?(?![a-z0-9])"
)
_PREFIXES = {"milli": "m", "micro": "u", "kilo": "k"}


def find_unit(text: str) -> Unit | None:
    """Look up a unit, also volts with their gain; None where it is not known.

    >>> find_unit("500 mN/V").times, find_unit("µN").name
    (500.0, 'un')

    Args:
        text: Unit as written, case does not matter.
    """
    name = text.strip().lower().translate(_MICRO)
    gain = _GAIN.fullmatch(name)
    if gain is None:
        return UNITS.get(name)
    unit = UNITS.get(gain["unit"])
    if unit is None or unit.quantity != "signal":
        return None
    times = float(gain["gain"] or 1.0) * unit.times
    return replace(unit, name=name, times=times, volts=gain["volts"])


def volts_of(name: str) -> str:
    """Volts that the name of a column says its samples are in; empty where it does not.

    >>> volts_of("Force (mV)"), volts_of("force_v"), volts_of("Force (500 mN/V)")
    ('mv', 'v', '')
    """
    said = [*_IN_VOLTS.finditer(name.lower().translate(_MICRO))]
    if not said:
        return ""
    prefix = said[-1]["prefix"]
    return _PREFIXES.get(prefix, prefix) + "v"


_BRACKETED = re.compile(r"^(?P<stem>.*\S)\s*[\[(]\s*(?P<unit>[^\])]+?)\s*[\])]$")


def split_unit(name: str) -> tuple[str, Unit | None]:
    """Split a column name into its stem and the unit it states.

    >>> split_unit("pressure_kPa")[0], split_unit("Force (N)")[1].name
    ('pressure', 'n')
    >>> split_unit("pdc")
    ('pdc', None)

    Returns:
        Stem, and the unit; the whole name and None where no known unit is stated.
    """
    text = name.strip()
    bracketed = _BRACKETED.match(text)
    if bracketed:
        stem, suffix = bracketed["stem"], bracketed["unit"]
    else:
        stem, _, suffix = text.rpartition("_")
    unit = find_unit(suffix)
    return (stem, unit) if stem and unit else (text, None)


def parse_unit(text: str) -> Unit:
    """Look up a unit that the user named.

    Raises:
        ConfigError: If the unit is unknown (`unknown_unit`).
    """
    unit = find_unit(text)
    if unit is None:
        known = [unit.name for unit in UNITS.values()]
        # One that differs by its prefix is another unit, thousands of times off.
        is_prefixed = find_unit(text.strip()[1:]) is not None
        hint = "; convert to one of these"
        hint = hint if is_prefixed else did_you_mean(text.lower(), known)
        raise ConfigError(
            f"unit {text!r} is not known; known here: {', '.join(known)}, and volts "
            f"with their gain, such as 500mN/V or N/mV{hint}",
            code="unknown_unit",
        )
    return unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A stated conversion between two signal units, with where it comes from.

    Args:
        source_unit: Canonical unit of the samples it applies to.
        target_unit: Canonical unit it gives.
        factor: Target units per source unit.
        provenance: Document or experiment that the factor comes from.
    """

    source_unit: str
    target_unit: str
    factor: float
    provenance: str


# Only a default to choose on purpose: nothing in the package applies it by itself, and
# the electronics of one finger may differ from the manual's.
BIOTAC_PDC = Calibration(
    source_unit="counts",
    target_unit="kpa",
    factor=0.0365,
    provenance="SynTouch BioTac Product Manual V21 (2018): P_DC 0.0365 kPa per count",
)

CALIBRATIONS = {"biotac_pdc": BIOTAC_PDC}


def stated_calibration(section: CalibrationSection) -> Calibration:
    """Make a calibration as a configuration states it.

    Args:
        section: A known name, or what replaces parts of it, or all parts.
    """
    known = asdict(CALIBRATIONS[section.name]) if section.name else {}
    own = section.model_dump(exclude={"name"}, exclude_none=True)
    return Calibration(**{**known, **own})


# A tactile sensor that reads 2 MPa is broken or not in kPa: fingertips yield far below,
# and absolute pressure is about 101 kPa.
_MAX_KPA = 2000.0
# Idle raw counts of a 12-bit sensor lie in the hundreds to thousands.
_MIN_COUNTS = 500.0
# The largest raw count of a 16-bit sensor.
_MAX_COUNTS = 65535.0
# Pressure of the standard atmosphere [kPa]; messages state multiples of it.
_ATMOSPHERE = 101.3


def implausible_signal(values: Float[np.ndarray, " n"], unit: Unit) -> str | None:
    """Say why samples cannot be in the unit that they claim.

    Args:
        values: Samples as in the file, in `unit`; NaN is skipped.

    Returns:
        Value, rule and next step as one clause; None where nothing is wrong.
    """
    if unit.name != "kpa":
        return None
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return None
    level = float(np.median(np.abs(finite)))
    are_whole = np.array_equal(finite, np.rint(finite))
    if are_whole and _MIN_COUNTS <= level <= _MAX_COUNTS:
        return (
            f"median {level:g} and whole numbers only look like raw counts, "
            f"{level / _ATMOSPHERE:.3g} times atmospheric pressure in kPa; "
            "state the unit counts"
        )
    if level > _MAX_KPA:
        return (
            f"median {level:g} kPa is {level / _ATMOSPHERE:.3g} times atmospheric "
            "pressure, the samples look like Pa; state the unit pa"
        )
    return None


# A right angle is 1.571 rad, a turn 6.283; smaller than 0.2 everywhere is nothing to
# judge by.
_MAX_RADIANS = {"theta": 1.6, "alpha": 6.3}
_MIN_JUDGED = 0.2
# Elevations alone are if so many differ, by so much, and half are so large: robots
# miss a stated one by less. Not tuned.
_N_SWEPT, _SWEPT, _MIDDLE = 5, 0.5, 0.25
# Azimuths are if all of so many, besides 0, are round numbers of degrees as radians of
# two decimals: three numbers are by chance in one table of 500, whole degrees never.
_N_AZIMUTHS, _ROUND, _OF_TWO_DECIMALS = 3, 5.0, 0.3


def implausible_angles(
    angles: dict[str, tuple[Float[np.ndarray, " n"], Unit]],
    *,
    cure: Callable[[str], str] = "state the unit {}".format,
) -> str | None:
    """Say why push angles cannot be in the units that they claim.

    Both angles are judged together: a small elevation in degrees is common, a small
    elevation and a small azimuth in one file is not. Nor is a sweep of elevations
    within a degree or two.

    Args:
        angles: `theta` and `alpha`, as far as present: values as in the file, unit.
        cure: Next step where the unit is another.

    Returns:
        Value, rule and next step as one clause; None where nothing is wrong.
    """
    largest = {
        name: (float(np.nanmax(np.abs(values), initial=0.0)), unit.name)
        for name, (values, unit) in angles.items()
    }
    for name, (top, unit) in largest.items():
        if unit == "deg" and top > 360.0:
            return f"{name} reaches {top:g} degrees, over a full turn; check the column"
        if unit == "rad" and top > 2.0 * np.pi * 1.001:
            return f"{name} reaches {top:g} rad, more than a full turn; {cure('deg')}"
    small = all(
        unit == "deg" and top <= _MAX_RADIANS[name]
        for name, (top, unit) in largest.items()
    )
    if small and max((top for top, _ in largest.values()), default=0.0) > _MIN_JUDGED:
        found = ", ".join(f"|{name}| <= {top:g}" for name, (top, _) in largest.items())
        return f"{found} in degrees look like radians; {cure('rad')}"
    for name, word, are_radians in (
        ("theta", "elevations", _are_swept_radians),
        ("alpha", "azimuths", _are_round_in_degrees),
    ):
        top, unit = largest.get(name, (0.0, ""))
        if unit != "deg" or top > _MAX_RADIANS[name]:
            continue
        own = angles[name][0]
        # An azimuth of 0 is one in any unit.
        swept = np.unique(own[np.isfinite(own) & ((own != 0) | (name == "theta"))])
        if are_radians(swept):
            span = f"{swept[0]:.3g} to {swept[-1]:.3g} degrees"
            found = f"{swept.size} {word} from {span} look like radians"
            return f"{found}; {cure('rad')}, or round those meant to be one"
    return None


def _are_swept_radians(theta: Float[np.ndarray, " n"]) -> bool:
    """Whether elevations are no degrees, whatever the azimuths are."""
    is_sweep = theta.size >= _N_SWEPT and np.ptp(theta) >= _SWEPT
    return bool(is_sweep and np.median(np.abs(theta)) >= _MIDDLE)


def _are_round_in_degrees(alpha: Float[np.ndarray, " n"]) -> bool:
    """Whether azimuths are no degrees, whatever the elevations are.

    Directions are planned in steps of some degrees, of which those in radians are odd
    numbers that turn into round ones.
    """
    degrees = np.degrees(alpha)
    off = np.abs(degrees - _ROUND * np.rint(degrees / _ROUND))
    return alpha.size >= _N_AZIMUTHS and bool(off.max() <= _OF_TWO_DECIMALS)


def in_degrees(radians: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Angles [rad] as they were stated: -60°, not -59.99999999999999°.

    Returns:
        The round number of degrees of which this is the angle in radians, to the last
        bit; where there is none, the nearest number [deg].
    """
    degrees = np.degrees(radians)
    stated = degrees.round(DECIMALS)
    return np.where(np.radians(stated) == radians, stated, degrees)
