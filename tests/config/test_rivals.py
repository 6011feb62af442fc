"""Settings that are compared: what differs is what their names say."""

from pushfit.config.rivals import NEVER_ROLLS, NOISES, SOFT_SHARPNESS, rival_configs
from tests.fit.tables import config


def test_rivals_differ_in_the_transition_alone():
    base = config("[transition]\nsharpness = 3.0\n")
    rivals = rival_configs(base)
    assert rivals["soft"] == base
    assert rivals["hard"].transition.sharpness == "hard"
    assert rivals["no_rolling"].parameters.C_rr.fixed == NEVER_ROLLS
    assert rival_configs(config())["soft"].transition.sharpness == SOFT_SHARPNESS
    open_ = config('[transition]\nsharpness = "auto"\n')
    assert rival_configs(open_)["soft"] == open_
    assert rival_configs(open_)["hard"].transition.sharpness == "hard"
    for name, rival in rivals.items():
        same = rival.model_copy(
            update={"transition": base.transition, "parameters": base.parameters}
        )
        if name in NOISES:
            same = same.model_copy(update={"noise": base.noise})
            assert rival.transition == base.transition
            assert rival.noise != base.noise
        assert same == base
