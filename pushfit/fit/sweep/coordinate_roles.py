"""Which part each sampling coordinate plays in the sweep.

The outer coordinate u = ln(B |u(α)| / (A C_rr)) is ln tan θ_c without a preload; one
of ln B, ln C_rr and ln A makes room for it. The inner one is ln C_rr as a rule. Both
are swept; the others are Gaussian given them, or follow from the prior. Excluded: their
nodes (`pushfit.fit.sweep.outer_nodes`, `pushfit.fit.sweep.sheet`).
"""

from dataclasses import dataclass

from pushfit.fit.problem.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Roles:
    """Coordinates by role.

    Args:
        pivot: The sampling coordinate that u replaces; None where none is free.
        inner: The second swept coordinate; None where nothing is left for it.
        others: The rest of what heights depend on. Where ln s is drawn from its prior
            given B it comes first, because the shape of the ellipse hangs on it.
        conditional: Drawn from the prior given what precedes them.
        sigmas: Sampled noise.
    """

    pivot: str | None
    inner: str | None
    others: tuple[str, ...]
    conditional: tuple[str, ...]
    sigmas: tuple[str, ...]

    @property
    def has_s(self) -> bool:
        """Whether ln s is drawn from its prior given B."""
        return "ln_s" in self.conditional

    @property
    def n_held(self) -> int:
        """Leading coordinates that are given where the others are Gaussian."""
        return 3 if self.has_s else 2

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the sweep's coordinates; "outer" and "inner" come first."""
        return ("outer", "inner", *self.others)


def roles_of(problem: Problem) -> Roles:
    """Roles of the coordinates of a problem."""
    names = problem.names
    sigmas = tuple(name for name in names if name.startswith("ln_sigma_"))
    conditional = _conditional(problem)
    seen = [n for n in names if n not in (*sigmas, *conditional)]
    pivot = next((n for n in ("ln_B", "ln_C_rr", "ln_A") if n in seen), None)
    left = [name for name in seen if name != pivot]
    inner = next((n for n in ("ln_C_rr", "ln_A", *left) if n in left), None)
    others = tuple(name for name in left if name != inner)
    if "ln_s" in conditional:
        others = ("ln_s", *others)
    return Roles(
        pivot=pivot,
        inner=inner,
        others=others,
        conditional=conditional,
        sigmas=sigmas,
    )


def _conditional(problem: Problem) -> tuple[str, ...]:
    """Coordinates whose prior given the others is tabulated."""
    names = problem.names
    sees_tilt = problem.grasp.law.sees_tilt
    # A fixed ellipse of the support is one of B that changes with s.
    is_shape_open = "f1" in problem.data_names and "f1" not in names
    found = []
    if {"ln_A", "ln_r"} <= set(names):
        found.append("ln_r")
    # Tilting forces depend on s: there it is one of the others.
    if not sees_tilt and {"ln_B", "ln_s"} <= set(names) and not is_shape_open:
        found.append("ln_s")
    is_L_unseen = not sees_tilt and problem.grasp.support_span is None
    # With C_d fixed, L and s together make K_st, and B with it.
    if {"ln_L", "ln_s"} <= set(names) and is_L_unseen and "C_d" not in problem.fixed:
        found.append("ln_L")
    return tuple(found)
