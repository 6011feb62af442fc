"""Pictures of an exploration after its first pushes, on its way, and at its end.

python docs/pictures/make_exploration.py
"""

from pathlib import Path

import numpy as np

from pushfit import Explorer, Grasp, Parameters, Pushes, forward
from pushfit.config import parse_config
from pushfit.report.figures import save_figure
from pushfit.report.text.exploration import exploration_picture

HERE = Path(__file__).parent
CHANNELS = ("height_normal", "height_tangential")
TRUTH = Parameters(K_sn=800, K_dn=2000, K_st=400, C_rr=0.3, C_d=0.5, L=0.04)
SIGMA = 0.05
# Pushes after which a picture is made, and its name.
STEPS = {2: "exploration_begin", 5: "exploration_middle"}


def main() -> None:
    """Explore a simulated grasp and draw it."""
    rng = np.random.default_rng(0)
    explorer = Explorer(
        parse_config("[push]\nlength_mm = 5.0\n", path="grasp.toml"),
        width_deg=6.0,
        sigma=SIGMA,
        channels=CHANNELS,
    )
    grasp = Grasp(push_length=0.005)
    while suggestions := explorer.ask(3):
        n = explorer.state.n_pushes
        if n in STEPS:
            figure = exploration_picture(explorer, suggestions)
            save_figure(figure, HERE / f"{STEPS[n]}.png")
        push = suggestions[0]
        felt = forward(
            TRUTH, Pushes(np.array([push.theta]), np.array([push.alpha])), grasp
        )
        heights = {
            name: float(getattr(felt, name)[0]) + SIGMA * rng.standard_normal()
            for name in CHANNELS
        }
        explorer.tell(push.theta, push.alpha, heights)
    save_figure(exploration_picture(explorer), HERE / "exploration.png")


if __name__ == "__main__":
    main()
