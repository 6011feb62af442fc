"""The page on a recording: a picture to click, a table to type in, and buttons.

All that is decided goes to a `Look`, all that is shown comes from it. The page loads
nothing; its address is on this machine only, and only for who knows its token.
Excluded: how files are written (`pushfit.cli.commands.look`).
"""

import itertools
import secrets
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from bokeh.application import Application
from bokeh.application.handlers import FunctionHandler
from bokeh.core.templates import FILE, get_env
from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.events import Event, Tap
from bokeh.layouts import column, row
from bokeh.models import (
    Button,
    CellEditor,
    Checkbox,
    ColumnDataSource,
    DataTable,
    Div,
    GlobalInlineStyleSheet,
    LayoutDOM,
    SelectEditor,
    Spinner,
    StringEditor,
    TableColumn,
    TextInput,
)
from bokeh.resources import INLINE
from bokeh.server.server import Server
from bokeh.settings import settings
from jaxtyping import Float
from jinja2 import Template

from pushfit.cli.look.panels import panels
from pushfit.cli.look.state import Look
from pushfit.errors import ConfigError, PushfitError
from pushfit.report.figures.components import heights_in
from pushfit.report.figures.recording import MAX_TIME
from pushfit.report.figures.style import DATA, GREY, axis_label
from pushfit.report.strings import printable

# Nothing but what is in the page, and the process that serves it.
PREAMBLE = """\
{% extends frame %}
{% block preamble %}
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="referrer" content="no-referrer">
<meta http-equiv="Content-Security-Policy" content="default-src 'none';
script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; font-src data:;
connect-src 'self'">
{% endblock %}
"""
# A canvas knows no colour scheme: all is turned at once, as figures in a report are.
STYLE = """\
body { font-family: system-ui, sans-serif; background: #fff; }
@media (prefers-color-scheme: dark) {
  html { background: #fff; filter: invert(.89) hue-rotate(180deg); }
}
"""
COMPONENTS = (
    "Each component has its rest level and, as a thick line, its height over the "
    "narrow shaded stretch that it was measured over"
)
JERKS = "; jerks, left out, are purple"
HELP = (
    "Click a hump to leave it out or to take it in. Type θ and α into the table, or "
    "fill in a plan: every α in turn, at it all θ, or the other way round, each so "
    "often in a row."
)
# Height of a line of the table, width of a field [px].
LINE, NARROW = 25, 150
# Lines of the table that are seen at once.
SCREEN = 17
# What the number of a push takes, as a share of the range of the signal.
HEADROOM = 0.1
HOST = "127.0.0.1"
YES, NO, NONE = "yes", "no", "–"
Save = Callable[[Look], str]
SourceColumns = Mapping[str, Sequence[object]]


class Page:
    """Widgets that show a `Look` and change it.

    Args:
        save: Writes the files and returns what to tell; None makes a page to read only.
    """

    def __init__(self, look: Look, *, title: str, save: Save | None) -> None:
        """Lay the page out and show what is known."""
        self._look = look
        # Seconds since 1970 would leave no room for themselves.
        is_clock = abs(look.time[0]) > MAX_TIME
        self._origin = float(np.floor(look.time[0])) if is_clock else 0.0
        self._marks, self._rows = ColumnDataSource(), ColumnDataSource()
        self._parts = [ColumnDataSource() for _ in look.components]
        self._status = _text("")
        self.refresh()
        drawn = panels(look, self._marks, self._parts, origin=self._origin)
        below = [self._status, self._table(is_live=save is not None)]
        above = []
        if look.components:
            has_jerks = any(own.is_jerk.any() for own in look.components)
            above.append(_text(f"{COMPONENTS}{JERKS if has_jerks else ''}."))
        if save is not None:
            for panel in drawn:
                panel.on_event(Tap, self._tapped)
            self._rows.on_change("data", self._edited)
            below[:0] = self._asked(save)
            above.insert(0, _text(HELP))
        self.root: LayoutDOM = column(
            _text(printable(title), size="1.3em"),
            *above,
            *drawn,
            *below,
            sizing_mode="stretch_width",
            stylesheets=[GlobalInlineStyleSheet(css=STYLE)],
        )

    def _asked(self, save: Save) -> list[LayoutDOM]:
        """What looks for humps, fills in directions, and saves."""
        look = self._look
        both = Checkbox(label="pushes go both ways", active=look.signed)
        theta = TextInput(title="θ of a plan [deg]", placeholder="0:90:15")
        alpha = TextInput(title="α of a plan [deg]", placeholder="0, 30, 60")
        repeats = Spinner(title="repeats", low=1, value=1, step=1, mode="int")
        repeats.name = "repeats"
        by_theta = Checkbox(label="every θ in turn")
        fill, keep = Button(label="Fill in"), Button(label="Save")
        keep.button_type = "primary"
        fill.on_click(
            lambda: self._do(
                lambda: look.fill(
                    theta.value,
                    alpha.value,
                    int(repeats.value or 1),
                    by_theta=bool(by_theta.active),
                )
            )
        )
        keep.on_click(lambda: self._do(save, look))
        both.on_change("active", lambda name, old, new: self._do(look.search, new))
        widgets: tuple[LayoutDOM, ...] = (theta, alpha, repeats, by_theta, fill, keep)
        for widget in widgets:
            widget.width = NARROW
        plan = row(*widgets, sizing_mode="stretch_width")
        plan.styles = {"flex-wrap": "wrap", "align-items": "end", "gap": "6px"}
        return [both, plan]

    def _table(self, *, is_live: bool) -> LayoutDOM:
        look = self._look
        titles = {"push": "push", "counts": "counts", "time": "time [s]"}
        titles |= {n: axis_label(n.replace("_", " "), look.unit) for n in look.heights}
        titles |= {"theta": "θ [deg]", "alpha": "α [deg]", "flags": "doubts"}
        widths = {"push": 45, "counts": 55, "time": 60, "theta": 60, "alpha": 60}
        editors = {"counts": SelectEditor(options=[YES, NO])}
        editors |= {"theta": StringEditor(), "alpha": StringEditor()}
        lines = len(look.humps) + 2
        return DataTable(
            source=self._rows,
            columns=[
                TableColumn(
                    field=name,
                    title=title,
                    width=widths.get(name, 80),
                    editor=editors.get(name, CellEditor()),
                )
                for name, title in titles.items()
            ],
            editable=is_live,
            auto_edit=True,
            sortable=False,
            reorderable=False,
            index_position=None,
            height=LINE * (min(lines, SCREEN) if is_live else lines),
            sizing_mode="stretch_width",
        )

    def refresh(self, said: str = "") -> None:
        """Show everything as it is now."""
        look = self._look
        frame, components = pd.DataFrame({"t_start_s": []}), look.components
        notes = look.notes
        try:
            found = look.measure()
            frame, components = found.frame, found.trace.components
            notes = (*notes, *found.cautions)
        except PushfitError as error:
            notes = (*notes, str(error))
        known = sum(look.is_directed(k) for k in look.pushes)
        counted = f"{len(look.pushes)} pushes count, {known} have their angles"
        lines = dict.fromkeys((said, counted, *notes))
        self._status.text = "\n".join(printable(line) for line in lines if line)
        # One row for each hump; what does not count has no height.
        frame = frame.assign(row=np.arange(len(frame))).set_index("t_start_s")
        starts = look.starts
        measured = frame.reindex(starts)
        heights = {n: _numbers(measured, f"{n}_{look.unit}") for n in look.heights}
        number = dict(zip(look.pushes, itertools.count(1)))
        push = [str(number.get(k, NONE)) for k in range(len(look.humps))]
        drawn = {"push": push, **self._drawn(measured, heights)}
        _put(self._marks, drawn)
        for source, component in zip(self._parts, components, strict=True):
            own = heights_in(component, frame, origin=self._origin).reindex(starts)
            _put(source, {**drawn, **_drawn_in_component(own)})
        _put(self._rows, {"push": push, **self._written(measured, heights)})

    def _drawn(
        self, measured: pd.DataFrame, heights: Mapping[str, Float[np.ndarray, " n"]]
    ) -> SourceColumns:
        """Where and how the picture shows each hump."""
        look, origin = self._look, self._origin
        low, high = float(look.signal.min()), float(look.signal.max())
        height, *others = heights.values()
        turned = -1.0 if look.config.peaks.invert else 1.0
        rest = turned * _numbers(measured, f"baseline_{look.unit}")
        if others:
            # The length of a change of force rests at zero.
            rest, height = np.zeros(len(measured)), np.hypot(height, *others)
        return {
            "left": [hump.t_start - origin for hump in look.humps],
            "right": [hump.t_end - origin for hump in look.humps],
            "peak": [hump.t_peak - origin for hump in look.humps],
            "top": [high + HEADROOM * (high - low)] * len(look.humps),
            "rest": rest.tolist(),
            "height": (rest + height).tolist(),
            "colour": [DATA if is_push else GREY for is_push in look.counts],
        }

    def _written(
        self, measured: pd.DataFrame, heights: Mapping[str, Float[np.ndarray, " n"]]
    ) -> SourceColumns:
        look = self._look
        flags = measured["flags"].fillna("") if "flags" in measured else [""]
        return {
            "counts": [YES if is_push else NO for is_push in look.counts],
            "time": [f"{hump.t_peak - self._origin:.2f}" for hump in look.humps],
            **{n: [_shown(h, "#.4g") for h in own] for n, own in heights.items()},
            "theta": [_shown(angle) for angle in look.theta_deg],
            "alpha": [_shown(angle) for angle in look.alpha_deg],
            "flags": [*flags] if len(flags) == len(measured) else [""] * len(measured),
        }

    def _tapped(self, event: Event) -> None:
        if isinstance(event, Tap) and event.x is not None:
            hump = self._look.at(event.x + self._origin)
            if hump is not None:
                self._do(self._look.toggle, hump)

    def _edited(self, name: str, old: SourceColumns, new: SourceColumns) -> None:
        """Take over what was typed; what the page itself wrote is no news."""
        look = self._look
        for k, is_push in enumerate(look.counts):
            if new["counts"][k] != (YES if is_push else NO):
                self._do(look.toggle, k)
            angles = (_shown(look.theta_deg[k]), _shown(look.alpha_deg[k]))
            typed = (str(new["theta"][k]), str(new["alpha"][k]))
            if typed != angles:
                self._do(look.direct, k, *typed)

    def _do(self, work: Callable[..., str | None], *arguments: object) -> None:
        """Do what was asked for, and show what came of it or why not."""
        try:
            said = work(*arguments) or ""
        except (PushfitError, OSError) as error:
            said = f"error: {error}"
        self.refresh(said)


def _drawn_in_component(own: pd.DataFrame) -> SourceColumns:
    """Where a component shows each hump otherwise, by what `heights_in` says."""
    return {
        "first": own["first_s"].tolist(),
        "last": own["last_s"].tolist(),
        "rest": own["baseline"].tolist(),
        "height": (own["baseline"] + own["height"]).tolist(),
    }


def static_page(look: Look, *, title: str) -> str:
    """The page without anything to click, as one file of HTML."""
    page = Page(look, title=title, save=None)
    return file_html(page.root, INLINE, _window(title), template=_template())


def start_server(
    look: Look, *, title: str, save: Save, port: int
) -> tuple[Server, str]:
    """Have the page at an address; it answers while the loop of the server runs.

    Args:
        look: What is shown; the same in every window, so that nothing is lost when a
            page is loaded again.
    """

    def open_page(document: Document) -> None:
        document.add_root(Page(look, title=title, save=save).root)
        document.title = _window(title)
        document.template = _template()

    path = f"/{secrets.token_urlsafe(32)}"
    try:
        server = Server(
            {path: Application(FunctionHandler(open_page))},
            address=HOST,
            port=port,
            # At /, a list of pages, or the way to the only one, would tell the token.
            use_index=False,
        )
    except OSError as error:
        raise ConfigError(
            f"port {port}: {error.strerror}; name another, or 0 for a free one",
            code="port",
        ) from error
    # Set here, these have the last word over the environment of the user.
    settings.allowed_ws_origin = [f"{HOST}:{server.port}"]
    settings.resources = "inline"
    server.start()
    return server, f"http://{HOST}:{server.port}{path}"


def _window(title: str) -> str:
    """Title of the browser's window."""
    return printable(f"pushfit look: {title}")


def _template() -> Template:
    """Frame of the page: Bokeh's own, in which nothing may be loaded."""
    return get_env().from_string(PREAMBLE, globals={"frame": FILE})


def _text(text: str, *, size: str = "1em") -> Div:
    """Words in which nothing is markup."""
    styles: dict[str, str | None] = {"font-size": size, "white-space": "pre-wrap"}
    styles["overflow-wrap"] = "anywhere"
    return Div(
        text=text, render_as_text=True, styles=styles, sizing_mode="stretch_width"
    )


def _shown(value: float, form: str = ".10g") -> str:
    """A number for a cell, angles as somebody would type them; empty where unknown."""
    return format(value, form) if np.isfinite(value) else ""


def _numbers(frame: pd.DataFrame, name: str) -> Float[np.ndarray, " n"]:
    """A column; NaN where it is not there."""
    if name not in frame:
        return np.full(len(frame), np.nan)
    return frame[name].to_numpy(dtype=float)


def _put(source: ColumnDataSource, columns: SourceColumns) -> None:
    """Show columns, and touch no cell that stays: somebody may be typing in others."""
    shown = dict(source.data)
    lengths = {name: len(own) for name, own in columns.items()}
    if {name: len(own) for name, own in shown.items()} != lengths:
        # Copies, because a patch changes them in place.
        source.data = {name: list(own) for name, own in columns.items()}
        return
    patches: dict[str, list[Any]] = {
        # As text, because NaN is not equal to itself.
        name: [(k, v) for k, v in enumerate(own) if str(v) != str(shown[name][k])]
        for name, own in columns.items()
    }
    changed = {name: own for name, own in patches.items() if own}
    if changed:  # else a cell that is being typed in would be closed
        source.patch(changed, setter=None)
