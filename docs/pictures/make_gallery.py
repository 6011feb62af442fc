"""Draw the pictures of the gallery and of the page on identifiability.

    python docs/pictures/make_gallery.py [RESULT...]

RESULT is the folder of the tutorial, and for the walkers that of the same pushes by
`--engine emcee`; without them, only the pictures on identifiability are drawn. Run from
the root of the repository.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from pushfit.report.figures import all_figures
from pushfit.report.figures.style import (
    ALARM,
    BLUE,
    GREY,
    ORANGE,
    new_figure,
    styled,
)
from pushfit.report.result import load

FOLDER = Path(__file__).parent
# Names of the figures of a result, and what they are called here.
GALLERY = {
    "grasp": "grasp",
    "main": "main",
    "recording_2": "recording",
    "alpha": "alpha",
    "theta_c": "theta_c",
    "ellipse": "ellipse",
    "learned": "learned",
    "corner_combinations": "corner",
    "residuals": "residuals",
    "traces": "traces",
}
DPI = 110
PUSH_LENGTH = 0.005
A, B, C_RR = 520.0, 150.0, 0.5
THETA = np.linspace(0.0, 90.0, 361)


def heights(theta_deg: np.ndarray, a: float, b: float, c_rr: float) -> np.ndarray:
    """Magnitude of the force of a push [N], Eqs. (12) to (14)."""
    theta = np.radians(theta_deg)
    normal = a * PUSH_LENGTH * np.sin(theta)
    tangential = np.minimum(c_rr * normal, b * PUSH_LENGTH * np.cos(theta))
    return np.hypot(normal, tangential)


@styled
def springs() -> Figure:
    """Different springs, one A, one curve."""
    figure = new_figure(width=7.2, height=2.8)
    left, right = figure.subplots(1, 2)
    K_sn = np.geomspace(550.0, 20_000.0, 200)
    left.loglog(K_sn, A * K_sn / (K_sn - A), color=BLUE)
    pairs = ((700.0, "o"), (1040.0, "s"), (5000.0, "^"))
    for stiffness, marker in pairs:
        other = A * stiffness / (stiffness - A)
        left.plot(stiffness, other, marker, color=ALARM, mfc="white", ms=6)
        a = stiffness * other / (stiffness + other)
        right.plot(
            THETA[::40],
            heights(THETA[::40], a, B, C_RR),
            marker,
            color=ALARM,
            mfc="none",
            ms=5 + 3 * pairs.index((stiffness, marker)),
        )
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    left.set(xlabel="K_sn [N/m]", ylabel="K_dn [N/m]")
    left.set_title("all pairs with A = 520 N/m")
    right.plot(THETA, heights(THETA, A, B, C_RR), color=BLUE)
    right.set(xlabel="push elevation θ [°]", ylabel="peak height [N]")
    right.set_title("give the same heights")
    return figure


@styled
def two_answers() -> Figure:
    """A magnitude from two contacts whose critical angles are far apart."""
    figure = new_figure(width=7.2, height=2.8)
    left, right = figure.subplots(1, 2)
    contacts = (((A, B, C_RR), BLUE, "-"), ((513.0, 265.0, 0.30), ORANGE, "--"))
    for (a, b, c_rr), colour, dashes in contacts:
        theta_c = np.degrees(np.arctan2(b, c_rr * a))
        label = f"θ_c = {theta_c:.0f}°"
        theta = np.radians(THETA)
        tangential = np.minimum(c_rr * a * np.sin(theta), b * np.cos(theta))
        left.plot(THETA, heights(THETA, a, b, c_rr), color=colour, ls=dashes)
        right.plot(
            THETA, PUSH_LENGTH * tangential, color=colour, ls=dashes, label=label
        )
        right.axvline(theta_c, color=colour, ls=":", lw=1)
    left.fill_between(
        THETA,
        heights(THETA, *contacts[0][0]) - 0.08,
        heights(THETA, *contacts[0][0]) + 0.08,
        color=GREY,
        alpha=0.25,
        lw=0,
    )
    left.set(xlabel="push elevation θ [°]", ylabel="height: magnitude [N]")
    left.set_title("3 % noise (grey) hides the difference")
    right.set(xlabel="push elevation θ [°]", ylabel="tangential force [N]")
    right.set_title("a tangential force shows it")
    right.legend()
    return figure


@styled
def save(figure: Figure, path: Path) -> None:
    """Write a picture small enough for a repository.

    Args:
        figure: What to write.
        path: Where to.
    """
    dpi = DPI if path.stem != "traces" else DPI / 2
    figure.savefig(path, dpi=dpi, metadata={"Software": None})


def main(arguments: list[str]) -> None:
    """Write the pictures.

    Args:
        arguments: Folders of results; the first that has a figure gives it.
    """
    figures = {"springs": springs(), "two_answers": two_answers()}
    for folder in reversed(arguments):
        drawn = all_figures(load(folder))
        figures |= {file: drawn[n] for n, file in GALLERY.items() if n in drawn}
    for name, figure in figures.items():
        save(figure, FOLDER / f"{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
