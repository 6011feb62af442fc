"""Forces of tilting mechanics, on as many supports as the grasp has.

Excluded: their equations (`pushfit.mechanics.tilting.one_support`,
`pushfit.mechanics.tilting.two_supports`).
"""

from pushfit.mechanics.containers import Contact, Forces, Grasp, Parameters, Pushes
from pushfit.mechanics.tilting.one_support import one_support_forces
from pushfit.mechanics.tilting.two_supports import two_support_forces


def tilting_forces(
    params: Parameters | Contact, pushes: Pushes, grasp: Grasp
) -> Forces:
    """Contact forces of pushes that tilt an object, on one support or on two.

    Those of `one_support_forces` or of `two_support_forces`, by what the grasp states.

    Args:
        params: Parameters, or the combinations that forces depend on.
        pushes: Directions.
        grasp: Push length, preload, tip radius and sharpness; states the span, if any.

    Returns:
        Forces of every push, in the frame that does not tilt [N].
    """
    is_single = grasp.support_span is None
    solve = one_support_forces if is_single else two_support_forces
    return solve(params, pushes, grasp)
