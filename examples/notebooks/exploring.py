# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3 (ipykernel)
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Which push next, and when to stop
#
# Open `exploring.ipynb` in Jupyter, or run `python examples/notebooks/exploring.py`
# from the root of the repository. The robot is simulated; heights are taken from its
# samples as from those of a real one.

# %%
from pathlib import Path

import pushfit
from pushfit.config.inputs import PeakSettings
from pushfit.explore.hands.simulated import joints_stated, simulated_hand
from pushfit.explore.loop import explore
from pushfit.report.figures.exploration import exploration_picture
from pushfit.report.text.exploration import next_text

ROOT = next(p for p in (Path.cwd(), *Path.cwd().parents) if (p / "examples").is_dir())
folder = ROOT / "examples" / "foam_box"

# %% [markdown]
# ## The question
#
# The critical angle θ_c to ± 3°, by heights that scatter by 0.1 kPa, with a finger that
# goes from −60° to 60° and joints that miss by up to half a degree, as the settings
# say.

# %%
explorer = pushfit.Explorer(
    joints_stated(pushfit.read_config(folder / "grasp.toml")),
    ask="theta_c",
    width_deg=6.0,
    sigma=0.1,
    unit="kpa",
)
print(next_text(explorer, explorer.ask(3)))

# %% [markdown]
# ## A hand
#
# The loop asks, pushes, feels and tells until there is an answer. A robot of your own
# is one class with the methods of `Hand`; who pushes by hand calls `explorer.tell`.

# %%
hand = simulated_hand(
    pushfit.read_config(folder / "truth.toml"),
    theta_deg=explorer.limits.theta_deg,
    unit="kpa",
    noise=0.05,
    scatter=0.01,
    forces=False,
    seed=1,
)


def show(step):
    """One push in a line."""
    push, known = step.suggestion, step.state.intervals["theta_c"]
    interval = "unknown" if known is None else f"{known[0]:.0f}° to {known[1]:.0f}°"
    print(f"push {push.number}: {push.describe()}, then θ_c {interval}")


state = explore(explorer, hand, settings=PeakSettings(), watch=show)
print(state.sentence)

# %% [markdown]
# What is known, what each push would have told, and how it went:

# %%
exploration_picture(explorer)

# %% [markdown]
# ## The result
#
# The pushes are a table like any other. Sets of the likelihood cover less than they
# state here, as the pushes were chosen by what earlier ones had said; posterior
# intervals keep their promise.

# %%
result = pushfit.identify(explorer.table, config=explorer.question.settings, seed=1)
result.plot("theta_c")

# %%
result
