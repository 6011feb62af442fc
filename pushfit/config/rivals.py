"""Settings that differ from those given in what is to be compared.

Excluded: comparing them (`pushfit.fit.comparison`).
"""

from pushfit.config import GraspConfig
from pushfit.config.parameters import PositivePrior

# Sharpness of the soft model where the configuration names none: at θ_c the tangential
# force then lies 8 % below the hard switch, at half and at twice the ratio of the two
# forces 0.05 %.
SOFT_SHARPNESS = 8.0
# C_rr of the model that never rolls: the limit C_rr F_n is then above any elastic force
# at elevations from 0.01° on, for ratios B/A up to 170.
NEVER_ROLLS = 1e6
# Noise of the models that differ in it.
NOISES: dict[str, dict[str, str]] = {
    "student_t": {"likelihood": "student_t"},
    "proportional": {"height_share": "estimate"},
    "offset": {"repeats": "offset"},
    "gain": {"repeats": "gain"},
}


def rival_configs(
    config: GraspConfig, *, has_repeats: bool = False
) -> dict[str, GraspConfig]:
    """The configuration with each way of rolling, other mechanics, and other noise.

    Tilting mechanics are among them where the push length and L are stated, and effects
    of repeats where noise is normal.

    Args:
        has_repeats: Whether any direction was pushed in two repeats.
    """
    stated = config.transition.sharpness
    soft = SOFT_SHARPNESS if stated == "hard" else stated
    hard = config.with_keys("transition", sharpness="hard")
    never = PositivePrior(fixed=NEVER_ROLLS)
    configs = {
        "hard": hard,
        "soft": config.with_keys("transition", sharpness=soft),
        "no_rolling": hard.with_keys("parameters", C_rr=never),
    }
    own = config.by_mechanics()[0].grasp.mechanics
    for rival in config.with_mechanics("auto").by_mechanics():
        name = rival.grasp.mechanics
        if name != own:
            configs[name] = rival.with_keys("transition", sharpness="hard")
    has_effects = has_repeats and config.noise.likelihood == "normal"
    for name, change in NOISES.items():
        rival = config.with_keys("noise", **change)
        is_possible = "repeats" not in change or (
            has_effects and config.noise.repeat_effect[0] in ("alike", "auto")
        )
        if is_possible and rival.noise != config.noise:
            configs[name] = rival
    return configs
