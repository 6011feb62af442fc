"""Draw the pictures of the pages on peaks and on force components.

Of peaks one argument each, off above and on below.

Run from the root of the repository: `python docs/pictures/make_pictures.py`.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pushfit.config import read_config
from pushfit.config.inputs import PeakSettings
from pushfit.data.load import configured_peaks, configured_recording
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.report.figures import save_figure, signal_figure
from pushfit.report.figures.recording import draw_pushes

FOLDER = Path(__file__).parent
LOGS = FOLDER.parents[1] / "examples" / "logs"
TIME = np.arange(0.0, 16.0, 0.01)
OFF = PeakSettings()
Picture = tuple[Recording, PeakSettings, PeakSettings]


def course(
    *tops: tuple[float, float], noise: float = 0.02, seed: int = 0
) -> np.ndarray:
    """Rounded pushes, each a time and a height, and noise."""
    level = sum(h * np.exp(-(((TIME - t) / 0.5) ** 2)) for t, h in tops)
    return level + noise * np.random.default_rng(seed).standard_normal(TIME.size)


def recording(**channels: np.ndarray) -> Recording:
    """Channels in newtons, all pushes in one direction."""
    return Recording(
        time=TIME,
        channels=channels,
        units=dict.fromkeys(channels, "n"),
        theta=np.full(TIME.size, 0.5),
        alpha=np.zeros(TIME.size),
    )


FOUR = ((2.0, 1.0), (6.0, 0.8), (10.0, 1.2), (14.0, 0.9))


def channel() -> Picture:
    both = recording(
        thumb=course(*FOUR), finger=course((4.0, 0.7), (12.0, 1.0), seed=1)
    )
    return both, PeakSettings(channel="thumb"), PeakSettings(channel="finger")


def normal() -> Picture:
    forces = recording(fz=course(*FOUR), fx=0.5 * course(*FOUR, seed=2))
    return forces, PeakSettings(channel="fz"), PeakSettings(normal="fz")


def invert() -> Picture:
    half = recording(p=course(*FOUR[:2], (10.0, -0.35), (14.0, -0.3)))
    return half, OFF, PeakSettings(invert=True)


def signed() -> Picture:
    mixed = recording(p=course((2.0, 1.0), (6.0, -0.8), (10.0, 1.2), (14.0, -0.9)))
    return mixed, OFF, PeakSettings(signed=True)


def height() -> Picture:
    def held(start: float, level: float) -> np.ndarray:
        rise = np.clip((TIME - start) / 0.3, 0, 1) * np.clip(
            (start + 2.3 - TIME) / 0.3, 0, 1
        )
        overshoot = 0.25 * np.exp(-np.clip(TIME - start - 0.3, 0, None) / 0.15)
        return level * rise * (1 + overshoot * (TIME > start))

    noise = course()
    pushes = recording(p=noise + held(1.5, 1.0) + held(6.5, 0.8) + held(11.5, 1.2))
    return pushes, PeakSettings(height="apex"), PeakSettings(height="plateau")


def min_height() -> Picture:
    brushed = recording(p=course((2.0, 1.0), (6.0, 0.25), (10.0, 1.2), (14.0, 0.3)))
    return brushed, OFF, PeakSettings(min_height=0.5)


def split() -> Picture:
    humps = recording(
        p=course((2.0, 1.0), (3.1, 0.9), (8.0, 1.2), (9.15, 1.0), (13.5, 0.9))
    )
    return humps, PeakSettings(split=0.2), PeakSettings(split=0.8)


def smoothing() -> Picture:
    tremble = 0.3 * np.sin(2 * np.pi * 1.6 * TIME) * (course(*FOUR, noise=0) > 0.1)
    shaky = recording(p=course(*FOUR) + tremble)
    return (
        shaky,
        PeakSettings(smoothing=0.1, split=0.6),
        PeakSettings(smoothing=0.8, split=0.6),
    )


def limit() -> Picture:
    return recording(p=course(*FOUR)), OFF, PeakSettings(limit=0.95)


def draw(axes: object, made: Recording, settings: PeakSettings, title: str) -> None:
    """Draw one way of taking the pushes."""
    table = extract_peaks(made, settings=settings)
    frame = table.frame
    shown = settings.channel or settings.normal or next(iter(made.channels))
    for name, signal in made.channels.items():
        colour, width = ("C0", 1.0) if name == shown else ("0.7", 0.7)
        axes.plot(made.time, signal, color=colour, lw=width)
    draw_pushes(
        axes,
        frame.assign(
            baseline=frame.get("baseline_n", 0.0),
            height=(-1.0 if settings.invert else 1.0)
            * table.heights(table.channels[0]),
        ),
    )
    axes.set_title(title, loc="left", fontsize=8)
    axes.tick_params(labelsize=7)


PICTURES: dict[str, tuple[Callable[[], Picture], str, str]] = {
    "channel": (channel, 'channel = "thumb"', 'channel = "finger"'),
    "normal": (normal, 'channel = "fz"', 'normal = "fz", with fx (grey) across it'),
    "invert": (invert, "invert = false", "invert = true"),
    "signed": (signed, "signed = false", "signed = true"),
    "height": (height, 'height = "apex"', 'height = "plateau"'),
    "min_height": (min_height, "min_height absent", "min_height = 0.5"),
    "split": (split, "split = 0.2", "split = 0.8"),
    "smoothing": (smoothing, "smoothing = 0.1", "smoothing = 0.8"),
    "limit": (limit, "limit absent", "limit = 0.95"),
}


def missing(figure: Figure) -> None:
    """One planned push of six was not made: refused, or left out with a note."""
    made = recording(p=course(*((t, 1.0) for t in (1.5, 4.0, 9.0, 11.5, 14.0))))
    plan = PushSchedule.planned(0.5, np.zeros(6), repeats=1)
    settings = PeakSettings(allow_missing=True)
    axes = figure.subplots()
    draw(axes, made, settings, "push 3 of 6 is told to be missing")
    found = extract_peaks(made, plan, settings=settings).frame
    for push, when in zip(found["push"], found["t_peak_s"], strict=True):
        axes.annotate(f"push {push}", (when, 1.12), ha="center", fontsize=7)
    axes.set_ylim(top=1.3)


def forces() -> Figure:
    """The picture of the command on the page on force components."""
    config = read_config(LOGS / "forces.toml")
    made = configured_recording(LOGS / "forces.csv", config)
    table = configured_peaks(made, LOGS / "forces_schedule.csv", config)
    return signal_figure(table.traces[0], table)


def save(figure: Figure, name: str) -> None:
    figure.savefig(FOLDER / f"{name}.png", dpi=80, metadata={"Software": None})


def main() -> None:
    """Draw all pictures."""
    for name, (make, above, below) in PICTURES.items():
        made, off, on = make()
        figure = Figure(figsize=(7.0, 3.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, sharey=True)
        draw(upper, made, off, above)
        draw(lower, made, on, below)
        lower.set_xlabel("time [s]", fontsize=8)
        save(figure, name)
    figure = Figure(figsize=(7.0, 1.8), layout="constrained")
    missing(figure)
    save(figure, "allow_missing")
    save_figure(forces(), FOLDER / "forces.png")


if __name__ == "__main__":
    main()
