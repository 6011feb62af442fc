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
# # From a recording to θ_c and α*
#
# Open `tutorial.ipynb` in Jupyter, or run `python examples/notebooks/tutorial.py` from
# the root of the repository. The recordings are simulated.

# %%
from pathlib import Path

import pushfit
from pushfit.report.figures import save_figure, signal_figure

ROOT = next(p for p in (Path.cwd(), *Path.cwd().parents) if (p / "examples").is_dir())
folder = ROOT / "examples" / "foam_box"

# %% [markdown]
# ## Everything in one call
#
# One recording for each sweep, each with the schedule of its pushes. What is known of
# the grasp is in `grasp.toml`; a dictionary would do as well.

# %%
result = pushfit.identify(
    [folder / "theta_sweep.csv", folder / "alpha_sweep.csv"],
    [folder / "theta_schedule.csv", folder / "alpha_schedule.csv"],
    config=folder / "grasp.toml",
    seed=1,
)
result

# %% [markdown]
# Before you quote a number, read the warnings of the card. The same in text:

# %%
print(result.summary())

# %% [markdown]
# ## Look at the pushes
#
# Every push is shaded and labelled with its direction.

# %%
result.plot("recording_2")

# %% [markdown]
# ## One number at a time
#
# A parameter is a number where the data say something about it. What they leave open
# refuses to be one.

# %%
rolling = result.params["C_rr"]
print(f"C_rr = {rolling:.3f}, that is {rolling}, {rolling.verdict.value}")
result.to_frame()[["estimate", "lower", "upper", "unit", "verdict"]]

# %%
result.plot("theta_c")

# %% [markdown]
# In pairs: which combinations the data fix.

# %%
result.plot("corner_combinations") if "f1" in result.params else result.plot("learned")

# %% [markdown]
# ## The same step by step
#
# To look between the steps, or to change something there.

# %%
recording = pushfit.read_recording(folder / "alpha_sweep.csv")
schedule = pushfit.read_schedule(folder / "alpha_schedule.csv")
table = pushfit.extract_peaks(recording, schedule)
table.frame.groupby("alpha_deg")["height_kpa"].agg(["mean", "std", "count"])

# %%
signal_figure(table.traces[0], table)

# %% [markdown]
# ## Keep it
#
# `result.save("result")` writes the folder that `pushfit identify --out` writes, and
# `pushfit.load("result")` reads it. A single figure:

# %%
save_figure(result.plot(), Path("main.png"))
