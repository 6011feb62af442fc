"""A result to hold: what one table told, ready to print, plot, save and pass on.

A `Result` is an `Identification` that shows itself. Excluded: numbers that may not be
quoted, whether it is fresh or read back from a folder.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from pushfit.arguments import checked
from pushfit.fit.results import Identification, Quantity, Verdict
from pushfit.report.answers import ANSWERS
from pushfit.report.fact_rows import quantity_cells, verdict_word
from pushfit.report.figures import plot
from pushfit.report.frames import result_frame
from pushfit.report.html.card import card_html, latex_table, markdown_table
from pushfit.report.json_values import Json
from pushfit.report.store.archive import chains_tree
from pushfit.report.store.folder import write_result_folder
from pushfit.report.store.output_folder import PARTS, left_out
from pushfit.report.store.read import read_extra, read_result
from pushfit.report.store.summary import summary_dict
from pushfit.report.strings import symbol, with_unit
from pushfit.report.text.result import render_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from xarray import DataTree


class Value(Quantity):
    """One number with everything that may honestly be said of it.

    `float(value)` and `f"{value:.3g}"` give the estimate where it may be quoted,
    `str(value)` estimate, interval and unit with the digits that the interval
    justifies.

    Examples:
        >>> sets = {"prob": 0.9, "sets": (), "likelihood_sets": ()}
        >>> about = {"verdict": Verdict.DETERMINED, "contraction": 0.9, "note": ""}
        >>> numbers = {"estimate": 0.4812, "interval": (0.42, 0.55)}
        >>> C_rr = Value(name="C_rr", unit="1", **numbers, **sets, **about)
        >>> f"{C_rr:.3f}", str(C_rr)
        ('0.481', '0.48 (0.42 to 0.55)')
    """

    __slots__ = ()

    @classmethod
    def of(cls, quantity: Quantity) -> "Value":
        """The same quantity as a value."""
        return cls(**{f.name: getattr(quantity, f.name) for f in fields(quantity)})

    def __float__(self) -> float:
        """Estimate.

        Raises:
            ValueError: There is none to quote, or the model that gives it does not
                describe the heights.
        """
        if self.estimate is None or self.verdict is Verdict.PROVISIONAL:
            raise ValueError(
                f"{self.name} has no single estimate: "
                f"{verdict_word(self.verdict)}; see its interval and sets"
            )
        return float(self.estimate)

    def __format__(self, spec: str) -> str:
        """Estimate in a format of floats; without one the same as `str`."""
        return format(float(self), spec) if spec else str(self)

    def __str__(self) -> str:
        """Estimate, interval and unit; without an estimate the range or the verdict."""
        value, interval, _, verdict, _ = quantity_cells(self)
        if self.estimate is None:
            ranges = with_unit(interval, self.unit) if interval else ""
            return ", ".join(filter(None, [ranges, verdict])) or value
        number = with_unit(value, self.unit)
        text = f"{number} ({interval})" if interval else number
        is_claimed = self.verdict is not Verdict.PROVISIONAL
        return text if is_claimed else f"{text} {verdict}"

    def __repr__(self) -> str:
        """The same with its name and verdict."""
        text, word = str(self), verdict_word(self.verdict)
        return f"<{self.name}: {text if text.endswith(word) else f'{text}, {word}'}>"


class _Named(dict[str, Value]):
    """Values by name, which says what there is when asked for what is not."""

    def __missing__(self, name: str) -> Value:
        raise KeyError(
            f"no parameter is called {name}; there are {', '.join(self)}, and the "
            "angles are theta_c and alpha_star of the result"
        )


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class Result(Identification):
    """What one table told, with all ways to look at it.

    `print(result)` is the whole report, a notebook shows a card. The fields are those
    of `Identification`: `theta_c`, `alpha_star`, `parameters`, `combinations`,
    `warnings`, `status`, `table`, `fit`, `posterior` and so on.

    Args:
        extra: Files of its folder that no identification makes, by name: journal and
            picture of an exploration.
    """

    extra: Mapping[str, bytes] = field(default_factory=dict)

    @classmethod
    def of(cls, identification: Identification) -> "Result":
        """Result of an identification."""
        if isinstance(identification, cls):
            return identification

        def value(quantity: Quantity | None) -> Value | None:
            return None if quantity is None else Value.of(quantity)

        own = {f.name: getattr(identification, f.name) for f in fields(identification)}
        for name in ("theta_c", "alpha_star", "alpha_star_model_free"):
            own[name] = value(own[name])
        for name in ("parameters", "combinations"):
            own[name] = tuple(value(quantity) for quantity in own[name])
        return cls(**own)

    @property
    def params(self) -> Mapping[str, Value]:
        """Parameters and combinations by name, for example `params["K_sn"]`."""
        both = (*self.parameters, *self.combinations)
        return _Named({q.name: Value.of(q) for q in both})

    def summary(self) -> str:
        """The two answers and the warnings, a sentence each."""
        sentences = [answer(self).sentence for answer in ANSWERS.values()]
        return "\n".join([*sentences, *(warning.text for warning in self.warnings)])

    def to_frame(self) -> pd.DataFrame:
        """Angles, parameters and combinations, one row each; NaN is unknown.

        Returns:
            Indexed by name: `kind`, `estimate`, `lower`, `upper`, `prob`, `unit`,
            `verdict`, `contraction` and `note`.
        """
        return result_frame(self)

    def to_dict(self) -> dict[str, Json]:
        """Content of `summary.json`."""
        return summary_dict(self)

    def to_latex(self) -> str:
        """The table of numbers for a paper; needs the package booktabs."""
        return latex_table(self)

    def to_markdown(self) -> str:
        """The table of numbers for a page."""
        return markdown_table(self)

    def to_datatree(self) -> "DataTree":
        """Posterior, prior, data and fit for ArviZ, every walker a chain."""
        return chains_tree(self)

    def plot(
        self,
        name: str = "main",
        *,
        ax: "Axes | None" = None,
        fig: "Figure | SubFigure | None" = None,
    ) -> "Figure":
        """One of the figures of the report.

        Args:
            name: As the file in `figures` is called, for example "theta_c".
            ax: Axes to draw a figure of a single panel into.
            fig: Figure or subfigure to draw any figure into; without both it gets its
                own.

        Raises:
            ConfigError: This result has no such figure, or it does not fit into axes.
        """
        return plot(self, name, ax=ax, fig=fig)

    def save(
        self, folder: str | Path, *, force: bool = False, pictures: str | None = None
    ) -> Path:
        """Write the folder that `pushfit identify --out` writes.

        A warning says what a library that is missing leaves out.

        Args:
            folder: Folder to write; it appears complete or not at all.
            force: Replace a result that stands there.
            pictures: "png" or "svg" for every figure also in this format.

        Returns:
            The folder.

        Raises:
            ConfigError: Something stands there, or the parent does not exist.
        """
        lacking = left_out(*PARTS)
        if lacking:
            warnings.warn(lacking, stacklevel=2)
        return write_result_folder(
            self, Path(folder), force=force, pictures=pictures, extra=self.extra
        )

    def __str__(self) -> str:
        """The report."""
        return render_text(self)

    def __repr__(self) -> str:
        """Both answers in short."""
        answers = [answer(self) for answer in ANSWERS.values()]
        said = ", ".join(f"{symbol(a.name)} {a.short}" for a in answers)
        n_used = int(self.used.sum())
        return f"<pushfit result: {said}; {n_used} pushes, {self.status.name.lower()}>"

    def _repr_html_(self) -> str:
        """Card for a notebook."""
        return card_html(self)


@checked
def load(folder: str | Path) -> Result:
    """A result that `save` or `--out` wrote.

    Returns:
        The result with what may be quoted of it, and files of its exploration.

    Raises:
        DataError: The folder is no result, lacks a part, or is of another schema.
    """
    return replace(Result.of(read_result(folder)), extra=read_extra(folder))
