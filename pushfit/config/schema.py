"""What `grasp.toml` may say about a grasp and how its pushes are to be analysed.

The field descriptions are the documentation of the file: the template and the
reference page are made from them. Excluded: the text of the file
(`pushfit.config.file`) and the default priors (`pushfit.fit.problem.priors`).
"""

import hashlib
import json
import math
import operator
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, model_validator

from pushfit.config.explore import ExploreSection
from pushfit.config.inputs import PeakSettings, RecordingSection
from pushfit.config.parameters import ParametersSection
from pushfit.config.section import (
    ELEVATIONS,
    Elevations,
    Millimetres,
    NotBelowOne,
    NotNegative,
    Number,
    Positive,
    Probability,
    Section,
    setting,
)
from pushfit.config.sensor import SensorSection
from pushfit.errors import SettingsError
from pushfit.mechanics.registry import BUILT_IN, COMPARED, mechanics_named
from pushfit.parameters import HALF_TURN, SensorUnit

Estimate = Literal["estimate"]
Preload = NotNegative | Estimate | None


class PushSection(Section):
    """How far the finger pushes."""

    length_mm: Millimetres = setting(
        "length of the push vector; absent: unknown, and stiffness is not quoted",
        default=5.0,
        example=5.0,
    )
    length_known: bool = setting(
        "false beside a length: it is nominal, and heights compare directions only",
        default=False,
        example=False,
    )

    @model_validator(mode="before")
    @classmethod
    def know_a_given_length(cls, content: object) -> object:
        """Take a length for known unless the file says otherwise."""
        if isinstance(content, dict):
            return {"length_known": "length_mm" in content} | content
        return content

    @model_validator(mode="after")
    def check_known_is_given(self) -> "PushSection":
        """Refuse to call a length known that is only the default."""
        if self.length_known and "length_mm" not in self.model_fields_set:
            raise ValueError(
                "length_known = true needs length_mm; state it, or leave length_known "
                "out"
            )
        return self


_MECHANICS = "".join(f'"{name}": {law.summary}; ' for name, law in BUILT_IN.items())


def _known_mechanics(name: str) -> str:
    """A name that stands for mechanics."""
    if name != "auto":
        try:
            mechanics_named(name)
        except LookupError as error:
            words = str(error).replace("must be", 'must be "auto",', 1)
            raise ValueError(words) from error
    return name


class GraspSection(Section):
    """How the object is held."""

    mechanics: Annotated[str, AfterValidator(_known_mechanics)] = setting(
        _MECHANICS + '"auto": both where these are given, and the tilting '
        "ones lead where the tilt matters to θ_c; or the name of mechanics of your own",
        default="auto",
    )
    preload_n: Preload = setting(
        'normal force before the push [N], or "estimate"; absent: 0', example=2.0
    )
    preload_kpa: Preload = setting("the same as a pressure", example=12.0)
    preload_counts: Preload = setting("the same in sensor counts", example=330.0)
    preload_au: Preload = setting("the same in arbitrary units", example="estimate")
    support_span_mm: Positive | None = setting(
        "distance between two supports; absent: one rolling limit", example=40.0
    )
    tip_radius_mm: NotNegative | None = setting(
        "radius of the fingertips, pushing and supporting, which roll as "
        "the object tilts; absent: points",
        example=8.0,
    )
    reference_alpha_deg: Number | None = setting(
        "azimuth at which theta_c is quoted; absent: the most pushed one", example=90.0
    )

    @model_validator(mode="after")
    def check_one_preload(self) -> "GraspSection":
        """Refuse two statements of the same force."""
        given = [unit for unit in PRELOAD_UNITS if self._preload_as(unit) is not None]
        if len(given) > 1:
            keys = " and ".join(f"preload_{unit}" for unit in given)
            raise ValueError(f"{keys} are given; keep one of them")
        return self

    @property
    def preload(self) -> tuple[float | Estimate, str | None]:
        """Preload and its unit, as stated; (0, None) where nothing is."""
        for unit in PRELOAD_UNITS:
            value = self._preload_as(unit)
            if value is not None:
                return value, unit
        return 0.0, None

    def _preload_as(self, unit: str) -> float | Estimate | None:
        return getattr(self, f"preload_{unit}")


PRELOAD_UNITS = get_args(SensorUnit)


class ReachSection(Section):
    """Which directions the finger can push in."""

    theta_deg: Elevations = setting(
        "range of elevations in which pushes are suggested", default=ELEVATIONS
    )
    alpha_deg: tuple[Number, Number] = setting(
        "range of azimuths in which they are, and alpha* is sought",
        default=(0.0, 180.0),
    )

    @model_validator(mode="after")
    def check_range(self) -> "ReachSection":
        """Refuse a range that is empty or goes round more than once."""
        low, high = self.alpha_deg
        if not low < high <= low + 360:
            raise ValueError(
                f"alpha_deg = [{low:g}, {high:g}]: give [low, high] with "
                "low < high <= low + 360"
            )
        return self

    @property
    def is_whole(self) -> bool:
        """Whether it has every axis, pushing one way or the other: α* has no ends."""
        low, high = self.alpha_deg
        return high - low >= HALF_TURN


class TransitionSection(Section):
    """How the contact passes from rolling to elastic."""

    sharpness: Literal["hard", "auto"] | NotBelowOne = setting(
        '"auto": sharpness p of the soft minimum is one of the unknowns; '
        '"hard" (the paper) or p >= 1 where it is known',
        default="auto",
    )


class NoiseSection(Section):
    """How heights scatter."""

    sigma: Literal["auto", "given", "pooled", "sampled"] = setting(
        '"given" (sd columns), "pooled" (from repeats), "sampled" '
        '(a parameter) or "auto" (the first of them that the table allows)',
        default="auto",
    )
    likelihood: Literal["normal", "student_t", "auto"] = setting(
        '"normal", "student_t" (outlying pushes weigh less), or "auto": '
        "whichever has the higher evidence",
        default="auto",
    )
    height_share: NotNegative | Literal["estimate", "auto"] = setting(
        "noise in proportion to the height beside the constant one, 1 sd "
        'as a share of it, "estimate": as the residuals have it, or "auto": '
        "the same where they speak for it, else 0",
        default="auto",
    )
    repeats: Literal["alike", "offset", "gain", "auto"] = setting(
        '"alike", or each repeat of all directions has an "offset" or a '
        '"gain" of its own, as large as repeats differ, or "auto": '
        "the one that repeats speak for, if any",
        default="auto",
    )
    offset_sd: Positive | None = setting(
        "how much repeats differ by an offset, 1 sd in the unit of the heights; "
        "absent: as they do",
        example=0.05,
    )
    gain_sd: Positive | None = setting(
        "the same of a gain, as a share of the heights", example=0.03
    )
    theta_sd_deg: NotNegative | Literal["estimate"] | None = setting(
        'error of every elevation, 1 sd [deg], or "estimate": as the residuals have '
        "it; absent: the same where repeats speak for it, else 0, and a warning where "
        "errors of 1 deg would matter",
        example=1.0,
    )
    alpha_sd_deg: NotNegative | None = setting(
        "error of every azimuth, 1 sd [deg]; absent: that of elevations where it is "
        "estimated, else 0",
        example=1.0,
    )
    angle_errors: Literal["each", "shared"] = setting(
        '"each" push has errors of its own, or all repeats of a direction have '
        '"shared" ones, and are averaged',
        default="each",
    )

    @property
    def repeat_effect(self) -> tuple[str, float | None]:
        """What repeats differ by, and its standard deviation where it is stated."""
        for kind, sd in (("offset", self.offset_sd), ("gain", self.gain_sd)):
            if sd is not None:
                return kind, sd
        return self.repeats, None

    @property
    def angle_sd(self) -> tuple[float, float]:
        """Errors of θ and α [rad]; NaN where the residuals are to tell."""
        theta, alpha = self.theta_sd_deg or 0.0, self.alpha_sd_deg
        if theta == "estimate":
            theta, alpha = math.nan, math.nan if alpha is None else alpha
        return math.radians(theta), math.radians(alpha or 0.0)

    @model_validator(mode="after")
    def check_errors_agree(self) -> "NoiseSection":
        """Refuse what contradicts itself, and shared errors of which none is stated."""
        for kind, sd in (("offset", self.offset_sd), ("gain", self.gain_sd)):
            if sd is not None and self.repeats not in (kind, "auto"):
                raise ValueError(
                    f"{kind}_sd says how much repeats differ, and repeats = "
                    f'"{self.repeats}" that they do not, or otherwise; leave one out'
                )
        if self.offset_sd and self.gain_sd:
            raise ValueError(
                f"offset_sd = {self.offset_sd:g} and gain_sd = {self.gain_sd:g}: "
                "repeats have an offset or a gain; leave one of them out"
            )
        if self.angle_errors == "each":
            return self
        if not self.theta_sd_deg and not self.alpha_sd_deg:
            raise ValueError(
                'angle_errors = "shared" says what repeats share, and no error is '
                "stated; set theta_sd_deg or alpha_sd_deg"
            )
        if self.height_share not in (0, "auto"):
            raise ValueError(
                'angle_errors = "shared" averages repeats, whose noise in proportion '
                "to the height would be averaged, too; leave height_share out"
            )
        if self.repeat_effect[1] is not None:
            raise ValueError(
                'angle_errors = "shared" averages repeats, and leaves nothing of how '
                "these differ; leave offset_sd and gain_sd out"
            )
        return self


class ReportSection(Section):
    """What is quoted."""

    prob: Probability = setting("probability of the intervals and sets", default=0.9)
    wanted_width_deg: Positive = setting(
        "widest interval of theta_c and alpha* that counts as determined [deg]",
        default=30.0,
    )


class GraspConfig(Section):
    """All of `grasp.toml`."""

    push: PushSection = PushSection()
    grasp: GraspSection = GraspSection()
    sensor: SensorSection = SensorSection()
    reach: ReachSection = ReachSection()
    transition: TransitionSection = TransitionSection()
    parameters: ParametersSection = ParametersSection()
    noise: NoiseSection = NoiseSection()
    peaks: PeakSettings = PeakSettings()
    recording: RecordingSection = RecordingSection()
    report: ReportSection = ReportSection()
    explore: ExploreSection = ExploreSection()

    @model_validator(mode="after")
    def check_sections_agree(self) -> "GraspConfig":
        """Refuse sections that need each other and do not fit."""
        unknowns = (
            ("F_0", "an estimated preload", "grasp.preload_n", "estimate"),
            ("p", "an unknown sharpness", "transition.sharpness", "auto"),
        )
        stated = {"F_0": self.grasp.preload[0], "p": self.transition.sharpness}
        for name, what, key, word in unknowns:
            prior = getattr(self.parameters, name)
            if prior is None:
                continue
            if stated[name] != word:
                raise ValueError(
                    f"parameters.{name} is a prior of {what}; "
                    f'set {key} = "{word}" or remove it'
                )
            if prior.fixed is not None:
                raise ValueError(
                    f"parameters.{name} is a prior, and a value is none; "
                    f"set {key} = {prior.fixed:g}"
                )
        name = self.grasp.mechanics
        reason = None if name == "auto" else self.why_not(name)
        if reason is not None:
            raise ValueError(f'grasp.mechanics = "{name}": {reason}')
        return self

    def by_mechanics(self) -> tuple["GraspConfig", ...]:
        """The configuration for each of the mechanics to compute by, "linear" first."""
        names = (self.grasp.mechanics,)
        if names == ("auto",):
            names = tuple(name for name in COMPARED if self.why_not(name) is None)
        return tuple(self.with_mechanics(name) for name in names)

    def with_mechanics(self, name: str) -> "GraspConfig":
        """The same settings by mechanics of a name, or by "auto"."""
        return self.with_keys("grasp", mechanics=name)

    def with_keys(self, section: str, **keys: object) -> "GraspConfig":
        """The same settings but for some keys of a section, which are not checked."""
        own = getattr(self, section).model_copy(update=keys)
        return self.model_copy(update={section: own})

    def why_not(self, name: str) -> str | None:
        """Why mechanics do not apply, and what to do; None where they do."""
        for key, reason in mechanics_named(name).needs.items():
            if not operator.attrgetter(key)(self):
                return reason
        return None

    def preload_in(self, unit: str) -> float | Estimate:
        """Preload in the unit of the heights.

        Args:
            unit: Unit of the heights: n, kpa, counts or au.

        Raises:
            SettingsError: The file does not say how the two units convert.
        """
        value, given = self.grasp.preload
        if given is None or value == "estimate":
            return value
        factor = self.sensor.factor(given, unit)
        if factor is None:
            raise SettingsError(
                f"grasp.preload_{given} = {value:g}: the heights are in {unit} and "
                f"[sensor] does not say how {given} converts; "
                f"give preload_{unit} or add the factor to [sensor]",
                code="preload_unit",
            )
        return value * factor

    def digest(self) -> str:
        """Sha256 of the settings in canonical JSON, defaults included."""
        text = json.dumps(
            self.model_dump(mode="json"), sort_keys=True, separators=(",", ":")
        )
        return hashlib.sha256(text.encode()).hexdigest()
