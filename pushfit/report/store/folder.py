"""A result folder: complete or absent.

Everything is written beside the target under a hidden name, forced to disk and renamed.
What stands there already is refused, or with `force` stays whole until its successor is
complete. Where the target is a symbolic link, all of this is done to the folder that it
leads to. Nothing is removed that this module does not write. Excluded: reading it back
(`pushfit.report.store.read`).
"""

import json
import os
import secrets
import shutil
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from pushfit.atomic import followed, naming, sync, unfinished, whole
from pushfit.data.tables.peak_table import write_table
from pushfit.fit.results import Identification
from pushfit.report.figures import figure_files
from pushfit.report.html.result import NOTHING, is_shown, render_html
from pushfit.report.store.archive import posterior_tree
from pushfit.report.store.output_folder import check_target
from pushfit.report.store.summary import summary_dict
from pushfit.report.text.result import render_text


def write_result_folder(
    identification: Identification,
    out: Path,
    *,
    force: bool,
    pictures: str | None = None,
    extra: Mapping[str, bytes] = NOTHING,
) -> Path:
    """Write tables, posterior, summary, reports and figures of a result.

    Args:
        out: Folder to create, or a link to it; its parent exists.
        force: Replace a result folder that stands there.
        pictures: "png" or "svg" for every figure also in this format.
        extra: Content of further files, by names of `CONTENT`.

    Returns:
        The folder: `peaks.csv`, `result.nc`, `summary.json`, `report.txt`, `figures/`
        as the page shows them, lines as SVG and dense ones as PNG, and `report.html`
        where Jinja2 is installed.

    Raises:
        ConfigError: Something stands there and is not to be replaced, or the parent
            does not exist or takes no file.
    """
    check_target(out, force=force)
    token, target = secrets.token_hex(4), followed(out)
    fresh = target.with_name(f".{target.name}.{token}.partial")
    fresh.mkdir()
    with naming(out), unfinished(fresh):
        _write_content(identification, fresh, pictures=pictures, extra=extra)
        _sync_tree(fresh)
        with whole():
            _take_place(fresh, target, target.with_name(f".{target.name}.{token}.old"))
    return out


def _write_content(
    identification: Identification,
    folder: Path,
    *,
    pictures: str | None,
    extra: Mapping[str, bytes],
) -> None:
    """Write every file of a result; further pictures are on the page as well."""
    for name, content in extra.items():
        (folder / name).write_bytes(content)
    write_table(identification.table, folder / "peaks.csv")
    # In memory first: where the disk is full, HDF5 takes the process down with it. A
    # view that an error keeps would be complained of when its stream is collected.
    with posterior_tree(identification).to_netcdf(None, engine="h5netcdf") as posterior:
        (folder / "result.nc").write_bytes(posterior)
    summary = json.dumps(
        summary_dict(identification), indent=2, ensure_ascii=False, allow_nan=False
    )
    (folder / "summary.json").write_text(summary + "\n", encoding="utf-8")
    (folder / "report.txt").write_text(render_text(identification), encoding="utf-8")

    def is_wanted(name: str, suffix: str) -> bool:
        return suffix == pictures or is_shown(name, suffix)

    files = figure_files(identification, is_wanted=is_wanted)
    (folder / "figures").mkdir()
    for name, content in files.items():
        (folder / "figures" / name).write_bytes(content)
    if find_spec("jinja2"):
        page = render_html(identification, files=files, extra=extra)
        (folder / "report.html").write_text(page, encoding="utf-8")


def _take_place(fresh: Path, out: Path, old: Path) -> None:
    """Rename the finished folder to its name, the old one aside for that moment."""
    had_old = out.exists()
    if had_old:
        os.rename(out, old)
    try:
        os.rename(fresh, out)
    except BaseException:
        if had_old:
            os.rename(old, out)
        raise
    sync(out.parent)
    if had_old:
        shutil.rmtree(old, ignore_errors=True)


def _sync_tree(folder: Path) -> None:
    """Force every file and folder below to disk, the folder itself last."""
    for path in sorted(folder.rglob("*"), reverse=True):
        sync(path)
    sync(folder)
