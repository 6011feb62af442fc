"""The pictures on the page: the signal with its humps, force components below it.

They are what `pushfit peaks --plot` draws, on a canvas that is clicked. Excluded: where
humps are and how high (`pushfit.cli.look.page`), and what a click does.
"""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, DataRange1d
from bokeh.plotting import figure
from jaxtyping import Float

from pushfit.cli.look.state import Look
from pushfit.data.tables.traces import MAX_KEPT, ComponentTrace, envelope
from pushfit.report.figures.components import JERK, REST, SHADE, TOP, left_out_samples
from pushfit.report.figures.recording import COMPONENT, LETTERS
from pushfit.report.figures.style import BLACK, DATA, GREY, PURPLE, axis_label

# Height of the signal [px].
PICTURE = 320
# Of the shade over a push.
HUMP = 0.25
# More numbers than this stand on end.
DENSE = 40


def panels(
    look: Look,
    marks: ColumnDataSource,
    parts: Sequence[ColumnDataSource],
    *,
    origin: float,
) -> list[figure]:
    """The signal, and below it the components of a force, in time with it.

    Args:
        marks: Humps in the signal: from `left` to `right`, with a height from `rest` to
            `height` at `peak`, in their `colour`; numbers `push` below `top`.
        parts: The same humps in each component, with the stretch that the height was
            measured over, from `first` to `last`.
        origin: Time to count from [s].
    """
    first = _signal_panel(look, marks, origin)
    drawn = [first]
    for own, source in zip(look.components, parts, strict=True):
        panel = _component_panel(own, source, origin, unit=look.unit, above=first)
        drawn.append(panel)
    for panel in drawn[:-1]:
        panel.xaxis.visible = False
    after = f" after {origin:.0f} s" if origin else ""
    drawn[-1].xaxis.axis_label = f"time [s]{after}"
    return drawn


def _signal_panel(look: Look, marks: ColumnDataSource, origin: float) -> figure:
    time, signal = envelope(look.time, look.signal, max_points=MAX_KEPT)
    panel = _panel(
        time - origin,
        signal,
        marks,
        height=PICTURE,
        tools="xpan,xwheel_zoom,box_zoom,reset",
        y_axis_label=axis_label(look.name, look.unit),
    )
    panel.toolbar.logo = None
    is_dense = len(look.humps) > DENSE
    panel.text(
        x="peak",
        y="top",
        text="push",
        source=marks,
        text_align="right" if is_dense else "center",
        text_baseline="middle" if is_dense else "top",
        angle=np.pi / 2 if is_dense else 0.0,
        text_color=GREY,
        text_font_size="11px",
    )
    return panel


def _component_panel(
    own: ComponentTrace,
    marks: ColumnDataSource,
    origin: float,
    *,
    unit: str,
    above: figure,
) -> figure:
    time = own.time - origin
    panel = _panel(
        time,
        np.where(own.is_jerk, np.nan, own.signal),
        marks,
        height=round(COMPONENT * PICTURE),
        # A finger that drags here moves the page, not the time.
        tools="",
        toolbar_location=None,
        x_range=above.x_range,
        y_axis_label=fill(axis_label(own.name, unit), LETTERS),
    )
    shade = {"fill_color": GREY, "fill_alpha": SHADE, "line_color": None}
    panel.vstrip("first", "last", source=marks, **shade)
    black = {"source": marks, "color": BLACK}
    panel.segment("left", "rest", "right", "rest", line_width=REST, **black)
    panel.segment("first", "height", "last", "height", line_width=TOP, **black)
    # Jerks set no scale, as in the pictures.
    panel.y_range = DataRange1d(renderers=[*panel.renderers])
    if own.is_jerk.any():
        jerks = left_out_samples(own.signal, own.is_jerk)
        panel.line(time, jerks, color=PURPLE, line_width=JERK)
    return panel


def _panel(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    marks: ColumnDataSource,
    **options: Any,
) -> figure:
    """Samples over the shades of humps, and the height of each."""
    panel = figure(sizing_mode="stretch_width", **options)
    shade = {"fill_color": "colour", "fill_alpha": HUMP, "line_color": None}
    panel.vstrip("left", "right", source=marks, **shade)
    panel.line(time, signal, color=DATA)
    coloured = {"source": marks, "color": "colour"}
    panel.segment("peak", "rest", "peak", "height", line_width=2, **coloured)
    return panel
