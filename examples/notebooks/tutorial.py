# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From a recording to θ_c and α*
#
# Open this script as a notebook with jupytext, or run it from the root of the
# repository: `python examples/notebooks/tutorial.py`. The recordings are simulated.

# %%
from pathlib import Path

import numpy as np

import pushfit
from pushfit.report.figures import main_figure, save_figure, signal_figure
from pushfit.report.text import sentence_alpha_star, sentence_theta_c

folder = Path("examples/foam_box")
config = pushfit.read_config(folder / "grasp.toml")

# %% [markdown]
# ## Recordings to heights
#
# One recording for each sweep, each with the schedule of its pushes.

# %%
tables = []
for sweep in ("theta", "alpha"):
    recording = pushfit.read_recording(folder / f"{sweep}_sweep.csv")
    schedule = pushfit.read_schedule(folder / f"{sweep}_schedule.csv")
    tables.append(pushfit.extract_peaks(recording, schedule, settings=config.peaks))
table = pushfit.merge_tables(tables)
table.frame.head()

# %% [markdown]
# Look before you fit: every push is shaded and labelled with its direction.

# %%
signal_figure(table.traces[1], table)

# %% [markdown]
# ## What the heights say without a model
#
# At θ = 15° they are lowest near α = 65°.

# %%
slow = table.frame[np.isclose(table.frame["theta_deg"], 15.0)]
slow.groupby("alpha_deg")["height_kpa"].agg(["mean", "std", "count"])

# %% [markdown]
# ## What the model says
#
# This takes half a minute, and longer the first time.

# %%
result = pushfit.identify_table(table, config, seed=1)
print(sentence_theta_c(result))
print(sentence_alpha_star(result))

# %% [markdown]
# Read the warnings before you quote a number, and which parameters are the prior's.

# %%
for notice in result.warnings:
    print(f"{notice.code}: {notice.text}")
for quantity in result.parameters:
    print(f"{quantity.name:<5}{quantity.verdict.value}")

# %%
figure = main_figure(result)
save_figure(figure, Path("main.png"))
figure
