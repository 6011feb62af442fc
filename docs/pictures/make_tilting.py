"""Draw the picture of the page on tilting: forces of one sweep, θ_c of growing pushes.

Run from the root of the repository: `python docs/pictures/make_tilting.py`.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp, Parameters, Pushes, forward

FOLDER = Path(__file__).parent
THETA = np.radians(np.linspace(4.0, 90.0, 345))
LENGTHS_MM = np.linspace(0.1, 8.0, 60)
COLOURS = {"linear": "C1", "tilting": "C0"}


def contact(length: float) -> Parameters:
    """A = 520 N/m and C_rr = 0.5; B = 150 N/m at 40 mm."""
    return Parameters(1300, 2600 / 3, 450, 0.5, 0.36, length)


def draw_forces(axes: object) -> None:
    """Magnitude and tangential force of pushes by 5 mm, by both mechanics."""
    pushes = Pushes(THETA, np.zeros_like(THETA))
    for name, colour in COLOURS.items():
        grasp = Grasp(push_length=5e-3, mechanics=name)
        found = forward(contact(0.04), pushes, grasp)
        degrees = np.degrees(THETA)
        axes.plot(degrees, found.height, color=colour, label=f"|F|, {name}")
        axes.plot(
            degrees, found.height_tangential, "--", color=colour, label=f"F_t, {name}"
        )
        angle = critical_angle(contact(0.04), grasp, jnp.asarray(0.0))
        axes.axvline(np.degrees(float(angle)), color=colour, lw=0.7)
    axes.set_xlabel("θ [°]")
    axes.set_ylabel("force [N]")
    axes.set_title("a push of 5 mm, L = 40 mm (lines: θ_c)", loc="left", fontsize=9)
    axes.legend(fontsize=7)


def draw_angles(axes: object) -> None:
    """θ_c against the push length."""

    def angle(push_length: jax.Array, length: float) -> jax.Array:
        grasp = Grasp(push_length=push_length, mechanics="tilting")
        return critical_angle(contact(length), grasp, jnp.asarray(0.0))

    for length, style in ((0.04, "-"), (0.07, "--")):
        found = jax.vmap(lambda s, length=length: angle(s, length))(LENGTHS_MM / 1e3)
        small = critical_angle(
            contact(length), Grasp(push_length=1e-3), jnp.asarray(0.0)
        )
        label = f"L = {1000 * length:g} mm"
        axes.plot(LENGTHS_MM, np.degrees(found), style, color="C0", label=label)
        axes.axhline(np.degrees(float(small)), ls=style, color="C1", lw=0.9)
    axes.set_xlabel("push length [mm]")
    axes.set_ylabel("θ_c [°]")
    axes.set_title("level: the paper's equation (11)", loc="left", fontsize=9)
    axes.legend(fontsize=7)


def main() -> None:
    """Draw both panels."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_forces(left)
    draw_angles(right)
    figure.savefig(FOLDER / "tilting.png", dpi=90, metadata={"Software": None})


if __name__ == "__main__":
    main()
