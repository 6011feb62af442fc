"""Heights and forces that draws of a belief predict for pushes not yet made.

One compiled program serves every belief of a grasp: numbers of candidates are padded.
Excluded: which pushes are candidates (`pushfit.explore.limits`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from pushfit.explore.belief.belief import Belief
from pushfit.explore.records import Suggestion
from pushfit.fit.problem.problem import grasp_with
from pushfit.fit.programs.compile import compiled
from pushfit.model import Channels, Grasp, Parameters, Pushes, as_float, forward
from pushfit.parameters import OF_GRASP

# Candidates are padded to multiples of this, so that few programs are compiled.
PADDING = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicted:
    """What draws say of some pushes.

    Args:
        heights: Noise-free heights, by push, channel and draw [table unit].
        force: Magnitude of the contact force, the preload included [N, or unit].
        in_contact: False where a push lifts the finger off, by push and draw.
    """

    heights: Float[np.ndarray, "k c n"]
    force: Float[np.ndarray, "k n"]
    in_contact: Bool[np.ndarray, "k n"]


def predict(
    belief: Belief,
    theta: Float[np.ndarray, " k"],
    alpha: Float[np.ndarray, " k"],
    *,
    length_share: float = 1.0,
) -> Predicted:
    """Heights and forces of pushes, by every draw.

    Args:
        theta: Elevations [rad].
        alpha: Azimuths [rad].
        length_share: Length of the pushes, as a share of that of the grasp.
    """
    k = theta.size
    size = 1 if k == 1 else -(-k // PADDING) * PADDING
    rows = np.minimum(np.arange(size), k - 1)
    pushes = Pushes(theta[rows], alpha[rows])
    draws = {name: as_float(v) for name, v in belief.parameters.items()}
    heights, force, in_contact = _at_draws(
        draws, belief.grasp, pushes, as_float(length_share), belief.channels
    )
    return Predicted(
        heights=np.asarray(heights)[:k],
        force=np.asarray(force)[:k],
        in_contact=np.asarray(in_contact)[:k],
    )


def least_height(belief: Belief, push: Suggestion, *, prob: float) -> float:
    """Height that a push falls short of with a probability; of components its size."""
    theta, alpha = np.array([push.theta]), np.array([push.alpha])
    found = predict(belief, theta, alpha, length_share=push.length_share)
    sizes = np.linalg.norm(found.heights[0], axis=0)
    return weighted_quantile(sizes, belief.weights, prob)


def weighted_quantile(
    values: Float[np.ndarray, " n"], weights: Float[np.ndarray, " n"], prob: float
) -> float:
    """Value that draws whose weights sum to 1 stay below with a probability."""
    order = np.argsort(values)
    place = int(np.searchsorted(np.cumsum(weights[order]), prob))
    return float(values[order[min(place, order.size - 1)]])


def force_of(params: Parameters, grasp: Grasp, *, theta: float, alpha: float) -> float:
    """Force of one push, preload included [N, or unit of uncalibrated heights].

    Args:
        theta: Elevation [rad].
        alpha: Azimuth [rad].
    """
    found = _one(params, grasp, Pushes(np.array([theta]), np.array([alpha])))
    height = (float(found.height[0]) - float(grasp.offset)) / float(grasp.gain)
    return height + float(grasp.preload)


@compiled
def _one(params: Parameters, grasp: Grasp, pushes: Pushes) -> Channels:
    return forward(params, pushes, grasp)


@compiled
def _at_draws(
    draws: Mapping[str, Float[Array, " n"]],
    grasp: Grasp,
    pushes: Pushes,
    length_share: Float[Array, ""],
    channels: tuple[str, ...],
) -> tuple[Float[Array, "k c n"], Float[Array, "k n"], Bool[Array, "k n"]]:
    def one(
        draw: Mapping[str, Float[Array, ""]],
    ) -> tuple[Float[Array, "n c"], Float[Array, " n"], Bool[Array, " n"]]:
        own = {name: value for name, value in draw.items() if name not in OF_GRASP}
        held = replace(
            grasp_with(grasp, draw), push_length=grasp.push_length * length_share
        )
        found = forward(Parameters(**own), pushes, held)
        heights = jnp.stack([getattr(found, name) for name in channels], axis=1)
        force = (found.height - held.offset) / held.gain + held.preload
        return heights, force, found.in_contact

    return jax.vmap(one, out_axes=-1)(draws)
