"""What heights depend on: data coordinates and the contact they name.

Linear forces know the tangential springs through B alone. Where the object tilts,
ln s = ln(K_st L²/C_d) and ln L are data coordinates too; with K_st or C_d fixed, ln s
stands for ln B. Excluded: sampling coordinates (`pushfit.fit.problem.problem`).
"""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp

from pushfit.fit.problem.priors.distributions import Prior
from pushfit.mechanics.combinations import support
from pushfit.model import Contact, Grasp, Parameters, Scalar, contact

NamedScalars = Mapping[str, Scalar]


def data_names(
    priors: Mapping[str, Prior], fixed: Mapping[str, float], grasp: Grasp
) -> tuple[str, ...]:
    """Names of the data coordinates: the combinations that forces depend on.

    By mechanics that see the tilt they depend on s and L as well; where K_st or C_d is
    fixed, B follows from these.
    """
    sees_tilt, names = grasp.law.sees_tilt, []
    if not {"K_sn", "K_dn"} <= set(fixed):
        names.append("ln_A")
    is_B_known = {"K_st", "C_d", "L"} <= set(fixed)
    if sees_tilt:
        is_B_known = bool({"K_st", "C_d"} & set(fixed))
    if not is_B_known:
        names.append("ln_B")
    if "C_rr" in priors:
        names.append("ln_C_rr")
    # A fixed ellipse of the support is one of B only where s is known.
    has_shape = bool(fixed.get("e1", 0.0) or fixed.get("e2", 0.0)) and not sees_tilt
    if "e1" in priors or has_shape:
        names += ["f1", "f2"]
    if "F_0" in priors:
        names.append("ln_F_0")
    if "p" in priors:
        names.append("ln_p")
    if sees_tilt and {"K_st", "C_d"} & set(priors):
        names.append("ln_s")
    if "L" in priors and (sees_tilt or grasp.support_span is not None):
        names.append("ln_L")
    return tuple(names)


def data_point(y: NamedScalars, fixed: NamedScalars, grasp: Grasp) -> Contact:
    """Combinations that forces depend on."""
    point = tilting_point if grasp.law.sees_tilt else linear_point
    return point(y, fixed)


def linear_point(y: NamedScalars, fixed: NamedScalars) -> Contact:
    """Combinations that forces depend on where they know the springs by B alone."""
    zero = jnp.zeros(())
    return Contact(
        A=_series(y, fixed),
        B=jnp.exp(y["ln_B"]) if "ln_B" in y else _fixed_B(fixed),
        C_rr=jnp.exp(y["ln_C_rr"]) if "ln_C_rr" in y else fixed["C_rr"],
        f1=y.get("f1", zero),
        f2=y.get("f2", zero),
        L=jnp.exp(y["ln_L"]) if "ln_L" in y else fixed.get("L", zero + 1),
    )


def tilting_point(y: NamedScalars, fixed: NamedScalars) -> Contact:
    """Combinations that forces depend on where the object tilts."""
    L = jnp.exp(y["ln_L"]) if "ln_L" in y else fixed["L"]
    if "ln_s" in y:
        s = jnp.exp(y["ln_s"])
    else:
        s = fixed["K_st"] * L**2 / fixed["C_d"]
    C_rr = jnp.exp(y["ln_C_rr"]) if "ln_C_rr" in y else fixed["C_rr"]
    one = jnp.ones(())
    if "f1" in y:
        group = Contact(A=one, B=one, C_rr=C_rr, f1=y["f1"], f2=y["f2"], L=L, s=s)
        per_stiffness = 1 / support(group).K_st
    else:
        # At K_st = 1 every other stiffness is a share of it.
        ellipse = {name: fixed.get(name, jnp.zeros(())) for name in ("e1", "e2")}
        unit = Parameters(one, one, one, C_rr, L**2 / s, L, **ellipse)
        group = contact(unit)
        per_stiffness = group.B
    if "ln_B" in y:
        B = jnp.exp(y["ln_B"])
    else:
        K_st = fixed["K_st"] if "K_st" in fixed else s * fixed["C_d"] / L**2
        B = K_st * per_stiffness
    return eqx.tree_at(lambda g: (g.A, g.B), group, (_series(y, fixed), B))


def _series(y: NamedScalars, fixed: NamedScalars) -> Scalar:
    """A, from its log or from the fixed springs."""
    if "ln_A" in y:
        return jnp.exp(y["ln_A"])
    return fixed["K_sn"] * fixed["K_dn"] / (fixed["K_sn"] + fixed["K_dn"])


def _fixed_B(fixed: NamedScalars) -> Scalar:
    return 1 / (1 / fixed["K_st"] + fixed["L"] ** 2 / fixed["C_d"])
