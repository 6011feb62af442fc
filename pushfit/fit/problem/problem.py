"""One table with its grasp, noise model and priors: its log likelihood and prior.

Least squares, profiles, quadrature and emcee all take residuals and log densities from
`Problem`. The sweep takes its predictions and priors, and has the same likelihood with
sigma integrated out (`pushfit.fit.sweep.likelihood`). Two coordinate systems meet
here: `y`, the few combinations that the data see, and `x`, all that is sampled.
Excluded: searching and sampling.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Num

from pushfit.fit.problem.data_coordinates import data_point
from pushfit.fit.problem.priors.distributions import Prior
from pushfit.mechanics.coordinates import Coordinates, log_volume, parameters
from pushfit.mechanics.numerics import log1pc, norm2
from pushfit.model import (
    Contact,
    Grasp,
    Parameters,
    Pushes,
    Scalar,
    as_float,
    forward,
)
from pushfit.parameters import OF_GRASP, SIGNED, SIX

# Degrees of freedom of the Student-t likelihood: heavy tails with a finite variance.
STUDENT_DOF = 4.0
# Scale of such a variable of standard deviation 1: a number that says how much heights
# scatter is a standard deviation, whatever the shape of the noise.
STUDENT_SCALE = (1 - 2 / STUDENT_DOF) ** 0.5
# One compiled program serves every table of up to this many rows, or directions, then
# of a third more or half as many again, and so on: another length costs seconds, and a
# table that grows push by push meets few of them.
SMALLEST_BUCKET = 24

P = TypeVar("P", Parameters, Contact)
A = TypeVar("A", Array, np.ndarray)


class ModelPoint(eqx.Module, Generic[P]):
    """A point at which the model can be evaluated.

    Args:
        params: The parameters, or the combinations alone where these are unknown.
        preload: F_0 [N].
        sigma: Sampled standard deviation of each channel [table unit]; 0 where it is
            not sampled.
        log_volume: Log |det| of the map from the coordinates to the prior's scale.
        sharpness: p of the soft transition [-]; None where it is that of the grasp.
    """

    params: P
    preload: Scalar
    sigma: Float[Array, " c"]
    log_volume: Scalar
    sharpness: Scalar | None = None

    def grasp(self, grasp: Grasp) -> Grasp:
        """The grasp with what is unknown of it as this point has it."""
        values = {"F_0": self.preload}
        if self.sharpness is not None:
            values["p"] = self.sharpness
        return grasp_with(grasp, values)


class Problem(eqx.Module):
    """Data, grasp, noise and priors.

    Rows may be padded: `mask` says which entries are data, and the padding cannot
    reach any result or gradient.

    Args:
        pushes: Directions of the rows, or those that `repeats` refers to.
        observed: Heights by channel and row [table unit].
        sd: Known standard deviation of each height, 0 where unknown [table unit].
        reference_sigma: Standard deviation that weights the residuals of least squares.
        mask: Which entries of `observed` are data.
        grasp: What is known of grasp and sensor.
        priors: Prior of every free parameter and of every sampled sigma.
        fixed: Values of the parameters that are not free.
        channels: Names of the rows of `observed`.
        names: Names of the entries of x.
        data_names: Names of the entries of y.
        likelihood: "normal" or "student_t".
        constraint: What is known beforehand of data coordinates that heights hardly
            see, as residuals constraint · y - constraint_offset of unit variance; no
            rows where heights see all of them.
        constraint_offset: See `constraint`.
        repeats: 1 where a row repeats one of `pushes`, else 0; None where each row has
            its own.
        shared: Standard deviations of what the rows of a group have in common, 0 in
            other rows; groups have no row in common [table unit]. None without groups.
    """

    pushes: Pushes
    observed: Float[Array, "c n"] = eqx.field(converter=as_float)
    sd: Float[Array, "c n"] = eqx.field(converter=as_float)
    reference_sigma: Float[Array, "c n"] = eqx.field(converter=as_float)
    mask: Bool[Array, "c n"]
    grasp: Grasp
    priors: Mapping[str, Prior]
    fixed: Mapping[str, Scalar]
    channels: tuple[str, ...] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    data_names: tuple[str, ...] = eqx.field(static=True)
    likelihood: str = eqx.field(static=True, default="normal")
    constraint: Float[Array, "k q"] | None = None
    constraint_offset: Float[Array, " k"] | None = None
    repeats: Float[Array, "d n"] | None = None
    shared: Float[Array, "c g n"] | None = None

    @property
    def of_data(self) -> "Problem":
        """The same for functions of y: it lacks what these do not ask for.

        Problems that differ by priors, or by whether sigma is sampled, so share their
        programs.
        """
        return replace(self, priors={}, names=())

    @property
    def angles(self) -> Float[np.ndarray, "2 d"]:
        """θ and α of the pushes [rad]."""
        return np.stack([self.pushes.theta, self.pushes.alpha])

    @property
    def n_constraints(self) -> int:
        """Data coordinates that what is known beforehand holds in place."""
        return 0 if self.constraint is None else self.constraint.shape[0]

    @property
    def n_free(self) -> int:
        """Data coordinates that only heights hold."""
        return len(self.data_names) - self.n_constraints

    def predict(self, state: ModelPoint) -> Float[Array, "c n"]:
        """Noise-free heights of every channel and row [table unit]."""
        channels = forward(state.params, self.pushes, state.grasp(self.grasp))
        heights = jnp.stack([getattr(channels, name) for name in self.channels])
        return heights if self.repeats is None else heights @ self.repeats

    def differences(self, predicted: Float[A, "*k c n"]) -> Float[A, "*k c n"]:
        """Predictions less observations, with noise of its own each; 0 for padding.

            d - Σ_g v_g (1 - 1/√(1 + V_g)) / V_g Σ v_g d/σ²,   V_g = Σ v_g²/σ²

        v_g is what `shared` says of a group, σ the reference: this is σ times the
        inverse root of the covariance σ² + Σ_g v_g v_gᵀ. Arrays of NumPy stay such.
        """
        xp: Any = np if isinstance(predicted, np.ndarray) else jnp
        difference = xp.where(self.mask, predicted - xp.asarray(self.observed), 0.0)
        if self.shared is None:
            return difference
        v, sigma = xp.asarray(self.shared), xp.asarray(self.reference_sigma)
        root = (1 + _volumes(v, sigma)) ** 0.5
        part = xp.einsum("cgn,...cn->...cg", v / sigma[:, None] ** 2, difference)
        return difference - xp.einsum("cgn,...cg->...cn", v, part / (root + root**2))

    @property
    def log_determinant(self) -> Scalar:
        """Log determinant of the map in `differences`; 0 where nothing is shared."""
        if self.shared is None:
            return jnp.zeros(())
        return -jnp.sum(jnp.log1p(_volumes(self.shared, self.reference_sigma))) / 2

    def residuals(self, state: ModelPoint) -> Float[Array, " m"]:
        """(prediction - observation) / reference sigma, 0 for padding."""
        return self.residuals_of(self.predict(state))

    def residuals_of(self, predicted: Float[Array, "c n"]) -> Float[Array, " m"]:
        """The same of predicted heights.

        With the Student-t likelihood each residual r becomes the signed root of its
        deviance (ν + 1) ln(1 + r²/(ν - 2)), so that half the sum of squares stays the
        negative log likelihood up to a constant.
        """
        difference = self.differences(predicted) / self.reference_sigma
        if self.likelihood == "student_t":
            difference = _signed_root_deviance(difference / STUDENT_SCALE)
        return difference.ravel()

    def data_residuals(self, y: Float[Array, " q"]) -> Float[Array, " m"]:
        """`residuals` at data coordinates, followed by those of `constraint`."""
        return self.with_constraint(self.residuals(self.data_state(y)), y)

    def with_constraint(
        self, residuals: Float[Array, " n"], y: Float[Array, " q"]
    ) -> Float[Array, " m"]:
        """Residuals followed by those of `constraint` at data coordinates."""
        if self.constraint is None or self.constraint_offset is None:
            return residuals
        return jnp.concatenate(
            [residuals, self.constraint @ y - self.constraint_offset]
        )

    def noise(self, state: ModelPoint) -> Float[Array, "c n"]:
        """Standard deviation of every entry; 1 for padding [table unit].

        sqrt(sd² + sigma²) where sigma is sampled, else the reference sigma.
        """
        is_sampled = jnp.asarray(
            [f"ln_sigma_{channel}" in self.names for channel in self.channels]
        )
        sampled = norm2(self.sd, jnp.broadcast_to(state.sigma[:, None], self.sd.shape))
        sigma = jnp.where(is_sampled[:, None], sampled, self.reference_sigma)
        return jnp.where(self.mask, sigma, 1.0)

    def log_likelihoods(self, state: ModelPoint) -> Float[Array, "c n"]:
        """Normalised log density of every entry; 0 for padding."""
        sigma = self.noise(state)
        scaled = self.differences(self.predict(state)) / sigma
        if self.likelihood == "student_t":
            density = jax.scipy.stats.t.logpdf(scaled, STUDENT_DOF, scale=STUDENT_SCALE)
        else:
            density = jax.scipy.stats.norm.logpdf(scaled)
        return jnp.where(self.mask, density - jnp.log(sigma), 0.0)

    def log_likelihood(self, state: ModelPoint) -> Scalar:
        """Normalised log density of the data."""
        return jnp.sum(self.log_likelihoods(state)) + self.log_determinant

    def log_prior(self, x: Float[Array, " p"]) -> Scalar:
        """Normalised log density of x before the data."""
        state = self.state(x)
        values = _prior_scale(state, self.channels)
        densities = [
            prior.log_prob(values[name]) for name, prior in self.priors.items()
        ]
        return jnp.sum(jnp.stack(densities)) + state.log_volume

    def log_prob(self, x: Float[Array, " p"]) -> Scalar:
        """Unnormalised log posterior density of x; -inf wherever it is not finite."""
        value = self.log_prior(x) + self.log_likelihood(self.state(x))
        return jnp.where(jnp.isnan(value), -jnp.inf, value)

    def state(self, x: Float[Array, " p"]) -> ModelPoint[Parameters]:
        """The point of sampling coordinates in the order of `names`."""
        z = dict(zip(self.names, x, strict=True))
        K_sn, K_dn = _normal_pair(z, self.fixed)
        K_st, C_d, L, e1, e2, volume = _tangential_group(z, self.fixed)
        C_rr = jnp.exp(z["ln_C_rr"]) if "ln_C_rr" in z else self.fixed["C_rr"]
        preload = jnp.exp(z["ln_F_0"]) if "ln_F_0" in z else self.grasp.preload
        sigma = [z.get(f"ln_sigma_{c}", jnp.asarray(-jnp.inf)) for c in self.channels]
        return ModelPoint(
            Parameters(K_sn, K_dn, K_st, C_rr, C_d, L, e1, e2),
            preload,
            jnp.exp(jnp.stack(sigma)),
            volume,
            jnp.exp(z["ln_p"]) if "ln_p" in z else None,
        )

    def data_state(self, y: Float[Array, " q"]) -> ModelPoint[Contact]:
        """The point of coordinates in the order of `data_names`; its sigma is 0."""
        w = dict(zip(self.data_names, y, strict=True))
        group = data_point(w, self.fixed, self.grasp)
        preload = jnp.exp(w["ln_F_0"]) if "ln_F_0" in w else self.grasp.preload
        sharpness = jnp.exp(w["ln_p"]) if "ln_p" in w else None
        no_sigma = jnp.zeros(len(self.channels))
        return ModelPoint(group, preload, no_sigma, jnp.zeros(()), sharpness)


def bucket(n: int) -> int:
    """Padded length for n rows: 2^k or 3 2^k, so that few programs serve all tables."""
    power = 1 << max(n - 1, 0).bit_length()
    return max(SMALLEST_BUCKET, power * 3 // 4 if n <= power * 3 // 4 else power)


def padded(values: Num[np.ndarray, "*s n"], fill: float) -> Num[np.ndarray, "*s m"]:
    """The rows, and as many more as their `bucket` takes."""
    n = values.shape[-1]
    ends = np.full((*values.shape[:-1], bucket(n) - n), fill, dtype=values.dtype)
    return np.concatenate([values, ends], axis=-1)


def grasp_with(grasp: Grasp, values: Mapping[str, Scalar]) -> Grasp:
    """A grasp with those of its numbers, `OF_GRASP`, that a point or a draw names."""
    known = {field: values[name] for name, field in OF_GRASP.items() if name in values}
    return replace(grasp, **known)


def _normal_pair(
    z: Mapping[str, Scalar], fixed: Mapping[str, Scalar]
) -> tuple[Scalar, Scalar]:
    """K_sn and K_dn from ln A and ln r, or from whichever of them is fixed."""
    if "ln_r" not in z:
        return fixed["K_sn"], fixed["K_dn"]
    r = jnp.exp(z["ln_r"])
    if "K_sn" in fixed:
        return fixed["K_sn"], fixed["K_sn"] / r
    if "K_dn" in fixed:
        return fixed["K_dn"] * r, fixed["K_dn"]
    A = jnp.exp(z["ln_A"])
    return A * (1 + r), A * (1 + 1 / r)


def _tangential_group(
    z: Mapping[str, Scalar], fixed: Mapping[str, Scalar]
) -> tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]:
    """K_st, C_d, L, e1, e2 and the log volume, from whichever are coordinates.

    With K_st or C_d fixed, ln s takes the place of ln B; every such map of the free
    logs has |det| = 1. Only the step from f to e changes volume.
    """
    L = jnp.exp(z["ln_L"]) if "ln_L" in z else fixed["L"]
    zero = jnp.zeros(())
    e1, e2 = z.get("e1", fixed.get("e1", zero)), z.get("e2", fixed.get("e2", zero))
    if "ln_s" not in z:
        return fixed["K_st"], fixed["C_d"], L, e1, e2, zero
    s = jnp.exp(z["ln_s"])
    if "K_st" in fixed:
        return fixed["K_st"], fixed["K_st"] * L**2 / s, L, e1, e2, zero
    if "C_d" in fixed:
        return s * fixed["C_d"] / L**2, fixed["C_d"], L, e1, e2, zero
    if "f1" in z:
        coords = Coordinates(
            ln_A=zero,
            ln_B=z["ln_B"],
            ln_C_rr=zero,
            f1=z["f1"],
            f2=z["f2"],
            ln_r=zero,
            ln_s=z["ln_s"],
            ln_L=jnp.log(L),
        )
        p = parameters(coords)
        return p.K_st, p.C_d, L, p.e1, p.e2, log_volume(coords)
    mean = jnp.cosh(norm2(as_float(e1), as_float(e2)) / 2)
    K_st = jnp.exp(z["ln_B"]) * jnp.sqrt(1 + 2 * s * mean + s * s)
    return K_st, K_st * L**2 / s, L, as_float(e1), as_float(e2), zero


def _prior_scale(
    state: ModelPoint[Parameters], channels: tuple[str, ...]
) -> dict[str, Scalar]:
    """Every quantity that may have a prior, on the scale of that prior."""
    p = state.params
    scale = {name: jnp.log(getattr(p, name)) for name in SIX}
    scale |= {name: getattr(p, name) for name in SIGNED}
    scale["F_0"] = jnp.log(state.preload)
    if state.sharpness is not None:
        scale["p"] = jnp.log(state.sharpness)
    for channel, sigma in zip(channels, state.sigma, strict=True):
        scale[f"sigma_{channel}"] = jnp.log(sigma)
    return scale


def _volumes(shared: Any, sigma: Any) -> Any:
    """V_g by channel and group; see `Problem.differences`."""
    return ((shared / sigma[:, None]) ** 2).sum(axis=2)


def _signed_root_deviance(r: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Sign(r) sqrt((ν + 1) ln(1 + r²/ν)), smooth through 0."""
    ratio = log1pc(r * r / STUDENT_DOF)
    return r * jnp.sqrt((STUDENT_DOF + 1) / STUDENT_DOF * ratio)
