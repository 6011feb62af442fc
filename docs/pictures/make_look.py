"""Photograph the page of `pushfit look` in Chromium, one push clicked away.

Run from the root of the repository: `python docs/pictures/make_look.py`.
"""

import tempfile
from pathlib import Path

from tests.cli.look.chromium import chromium
from tests.cli.look.test_browser import POINT, open_page, press, view, wait_for
from tests.cli.look.test_server import looking

ROOT = Path(__file__).parents[2]
SWEEP = ROOT / "examples" / "foam_box" / "alpha_sweep.csv"


def main() -> None:
    """Write look.png beside this file."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "a.csv").write_bytes(SWEEP.read_bytes())
        profile = place / "profile"
        with looking(place) as (_, address), chromium(profile) as tab:
            open_page(tab, address, size="desktop")
            for name, text in (
                ("θ of a plan [deg]", "15"),
                ("α of a plan [deg]", "0:150:30"),
            ):
                press(tab, name)
                tab.type(text + "\n")
            tab.run("Bokeh.documents[0].get_model_by_name('repeats').value = 3")
            press(tab, "Fill in")
            wait_for(tab, "18 have their angles")
            tab.click(*view(tab, POINT, 10.7))
            wait_for(tab, "17 pushes count")
            tab.picture(Path(__file__).with_name("look.png"))


if __name__ == "__main__":
    main()
