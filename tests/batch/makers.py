"""Small files for batches."""

import csv
import zlib
from pathlib import Path

import numpy as np

HEADER = "theta_deg,alpha_deg,height_n"


def table_text(seed: int, n: int = 4) -> str:
    """A table of pushes, its heights drawn by a seed."""
    heights = np.random.default_rng(seed).uniform(1, 2, n).tolist()
    rows = [f"{5 * (k + 1)},90,{height!r}" for k, height in enumerate(heights)]
    return "\n".join([HEADER, *rows, ""])


def write_tables(folder: Path, *names: str, n: int = 4) -> Path:
    """Tables of different content, one for each name."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / f"{name}.csv").write_text(table_text(zlib.crc32(name.encode()), n))
    return folder


def read_csv(path: Path) -> list[dict[str, str]]:
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def outputs(folder: Path) -> dict[str, bytes]:
    """Content of the files of a batch, without the store."""
    names = ("results.csv", "failures.csv", "results.parquet", "population.csv")
    return {name: (folder / name).read_bytes() for name in (*names, "report.html")}
