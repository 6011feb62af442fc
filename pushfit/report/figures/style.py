"""How figures look: one palette, one set of rules, no pyplot state.

Colours are those of Okabe and Ito, told apart by readers with any colour vision and, by
lightness, in grey print. Text is never parsed as mathematics unless a figure asks for
it, so a `$` in a column name cannot stop a report. Excluded: words for numbers and
units (`pushfit.report.strings`).
"""

import functools
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

from pushfit.atomic import atomic_path
from pushfit.parameters import named
from pushfit.report.picture_file import picture_format
from pushfit.report.strings import printable, unit_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

P = ParamSpec("P")
R = TypeVar("R")

BLUE, VERMILLION, GREEN = "#0072B2", "#D55E00", "#009E73"
ORANGE, PURPLE, SKY, BLACK = "#E69F00", "#CC79A7", "#56B4E9", "#1A1A1A"
GREY, PALE = "#6E6E6E", "#D9D9D9"
# Neighbours differ in hue and in lightness.
SERIES = (BLUE, ORANGE, GREEN, PURPLE, VERMILLION, SKY, BLACK)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
DASHES = ("-", "--", "-.", ":")
# Of lines that mark an answer; of an estimate in full.
DASHED = (0, (4, 2))
ESTIMATE: Mapping[str, Any] = {"color": BLACK, "lw": 1.1, "ls": DASHED}
# Of the tips that show a set which may be narrower than a line [points].
TIP = 7

# More series than this are told apart by an ordered ramp, safe for every colour vision.
RAMP, RAMP_END = "cividis", 0.6

# What data say, what priors say, and what asks for attention, in every figure.
DATA, PRIOR, ALARM = BLUE, GREY, VERMILLION

STYLE = {
    "axes.grid": True,
    "axes.labelcolor": BLACK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "figure.dpi": 100,
    "figure.facecolor": "white",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "lines.linewidth": 1.6,
    "mathtext.fontset": "dejavusans",
    "savefig.dpi": 200,
    "svg.fonttype": "path",
    # Element names from the content: the same figure is the same file.
    "svg.hashsalt": "pushfit",
    "text.parse_math": False,
}

# Full width of a page and of one column of a two-column page [inch].
PAGE, COLUMN = 7.2, 3.5


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Decorator: run a drawing function under the style of this module."""

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        import matplotlib

        with matplotlib.rc_context(STYLE):  # pyright: ignore[reportArgumentType]
            return draw(*args, **kwargs)

    return wrapper


def new_figure(
    *,
    width: float,
    height: float,
    layout: Literal["constrained"] | None = "constrained",
) -> "Figure":
    """Empty figure [inch] that belongs to no window, and that a notebook shows."""
    return _shown_figure()(figsize=(width, height), layout=layout)


def canvas(
    axes: "Axes | None", *, width: float, height: float
) -> "tuple[Figure, Axes]":
    """Axes to draw into: those of the user, or a figure of their own."""
    if axes is None:
        figure = new_figure(width=width, height=height)
        return figure, figure.subplots()
    figure = axes.get_figure(root=True)
    if figure is None:
        raise ValueError("the axes belong to no figure any more; make new ones")
    return figure, axes


def sheet(
    fig: "Figure | SubFigure | None",
    *,
    width: float,
    height: float,
    layout: Literal["constrained"] | None = "constrained",
) -> "tuple[Figure, Figure | SubFigure]":
    """Room for panels: that of the user, or a figure of their own."""
    if fig is None:
        figure = new_figure(width=width, height=height, layout=layout)
        return figure, figure
    return fig.get_figure(root=True), fig


@functools.cache
def _shown_figure() -> "type[Figure]":
    """Figure with the method by which a notebook shows what pyplot does not know."""
    from matplotlib.figure import Figure

    class ShownFigure(Figure):
        """Figure that a notebook shows as a picture."""

        def _repr_png_(self) -> bytes:
            return figure_bytes(self, "png")

    return ShownFigure


@functools.cache
def _font_characters() -> frozenset[int]:
    from matplotlib.font_manager import findfont, get_font

    return frozenset(get_font(findfont(STYLE["font.family"])).get_charmap())


def drawable(text: str) -> str:
    """Text of a user, safe to draw: characters the font lacks become "?"."""
    known = _font_characters()
    return "".join(char if ord(char) in known else "?" for char in printable(text))


def math_symbol(name: str) -> str:
    """Letter of a quantity as mathtext; needs `parse_math=True` where it is drawn."""
    if name.startswith("ln_"):
        return f"ln {math_symbol(name.removeprefix('ln_'))}"
    record = named(name)
    if record is not None:
        return drawable(record.math)
    return drawable(name).replace("$", r"\$").replace("_", " ")


def series_colours(n: int) -> list[str]:
    """Colours of n ordered series."""
    if n <= len(SERIES):
        return list(SERIES[:n])
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    ramp = colormaps[RAMP]
    return [to_hex(ramp(RAMP_END * i / (n - 1))) for i in range(n)]


def angle_words(letter: str, value_deg: float) -> str:
    """Entry of a legend, "θ = −30°"."""
    return f"{letter} = {value_deg:g}°".replace("-", "\N{MINUS SIGN}")


def axis_label(name: str, unit: str) -> str:
    """Label with its unit in brackets, "height [kPa]"; none for a pure number."""
    label = drawable(unit_label(unit))
    return f"{drawable(name)} [{label}]" if label else drawable(name)


def symbol_label(name: str, unit: str) -> str:
    """The same with the letter of a quantity, as mathtext."""
    label = drawable(unit_label(unit))
    return f"{math_symbol(name)} [{label}]" if label else math_symbol(name)


def channel_label(channel: str, unit: str) -> str:
    """Axis label of a height channel, "normal height [N]"."""
    kind = channel.removeprefix("height").strip("_")
    return axis_label(f"{kind} height".strip() if kind else "peak height", unit)


def draw_tip(
    axes: "Axes", x: float, y: float, *, toward_deg: float, colour: str, **options: Any
) -> None:
    """Arrow head with its tip at a point: two of them show a set however narrow.

    Args:
        toward_deg: Where it points to, counter-clockwise from the right [deg].
    """
    from matplotlib.markers import CARETRIGHT, MarkerStyle

    shape = MarkerStyle(CARETRIGHT).rotated(deg=toward_deg)
    axes.plot(x, y, marker=shape, color=colour, ms=TIP, mew=0, zorder=6, **options)


def place_legend(axes: "Axes", **options: object) -> None:
    """Legend, if anything has a label."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**options)  # pyright: ignore[reportArgumentType]


# Lines and their soft edges need no more.
N_COLOURS = 128
# No date: a figure of the same numbers is the same file.
METADATA: Mapping[str, Mapping[str, str | None]] = {
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure; the suffix decides the format."""
    content = figure_bytes(figure, picture_format(path))
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


@styled
def figure_bytes(figure: "Figure", suffix: str) -> bytes:
    """Content of the file of a figure as "png", "svg" or "pdf"."""
    if figure.get_layout_engine() is not None:
        # Solved once and by one renderer: faster, and no picture depends on the format
        # that came before it.
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
    stream = io.BytesIO()
    metadata = dict(METADATA.get(suffix, {}))
    figure.savefig(stream, format=suffix, metadata=metadata)
    return with_palette(stream) if suffix == "png" else stream.getvalue()


def with_palette(picture: io.BytesIO) -> bytes:
    """A PNG of few colours in a third of the bytes."""
    from PIL import Image

    shown = Image.open(picture).convert("RGB")
    small = io.BytesIO()
    shown.quantize(N_COLOURS, method=Image.Quantize.FASTOCTREE).save(small, "png")
    return small.getvalue()
