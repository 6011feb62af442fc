"""Pictures of `make explore-demo` after its first pushes, on its way, and at its end.

python docs/pictures/make_exploration.py
"""

from pathlib import Path

from pushfit import Explorer, read_config
from pushfit.config.inputs import PeakSettings
from pushfit.explore.hands.simulated import joints_stated, simulated_hand
from pushfit.explore.loop import Step, explore
from pushfit.report.figures import save_figure
from pushfit.report.figures.exploration import exploration_picture

HERE = Path(__file__).parent
EXAMPLE = HERE.parents[1] / "examples" / "foam_box"
# Pushes after which a picture is made, and its name.
STEPS = {2: "exploration_begin", 5: "exploration_middle"}


def main() -> None:
    """Explore the example grasp and draw it."""
    explorer = Explorer(
        joints_stated(read_config(EXAMPLE / "grasp.toml")),
        sigma=0.1,
        unit="kpa",
    )
    hand = simulated_hand(
        read_config(EXAMPLE / "truth.toml"),
        theta_deg=explorer.limits.theta_deg,
        unit="kpa",
        noise=0.05,
        scatter=0.01,
        forces=False,
        seed=0,
    )

    def draw(step: Step) -> None:
        name = STEPS.get(step.state.n_pushes)
        if name is not None:
            figure = exploration_picture(explorer, explorer.ask(3))
            save_figure(figure, HERE / f"{name}.png")

    explore(explorer, hand, settings=PeakSettings(), watch=draw)
    save_figure(exploration_picture(explorer), HERE / "exploration.png")


if __name__ == "__main__":
    main()
