"""Mechanics of one's own, from one file to the result, as the docs show it."""

import json
import math
import pkgutil
import sys
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

from pushfit.cli import main
from pushfit.config.rivals import NOISES, rival_configs
from pushfit.data.simulate import simulate_table
from pushfit.errors import ConfigError
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.programs import folder as cache
from pushfit.fit.programs.compile import compiled
from pushfit.mechanics.directions import critical_angle
from pushfit.mechanics.registry import BUILT_IN, Deferred, has_foreign, mechanics_named
from pushfit.model import Grasp, Pushes, forces
from pushfit.report.store.read import read_result
from pushfit.report.store.summary import summary_dict
from tests.fit.tables import FRICTION_ONLY, config
from tests.problems import CASES, PUSH, paper_parameters
from tests.project.test_docs import ROOT, blocks, commands
from tests.tolerances import EXACT

PAGE = ROOT / "docs" / "own_mechanics.md"
EXAMPLE = ROOT / "examples" / "own_mechanics"
# The page states an interval of 1.9°; with other draws it stays below this [deg].
NARROW = 5.0
# The medians of some 500 independent draws of emcee scatter by 0.02 widths.
MEDIANS = 0.1
FIRM = CASES["firm"]
OWN = '[grasp]\nmechanics = "hertz"\n'
COUNTED = """\
from pushfit.mechanics.linear import linear_forces
from pushfit.mechanics.registry import Mechanics

TRACES = []


def counted_forces(params, pushes, grasp):
    TRACES.append(pushes.theta.shape)
    return linear_forces(params, pushes, grasp)


MECHANICS = Mechanics(title="t", summary="s", forces=counted_forces)
"""


def true_angle() -> float:
    """θ_c of the example: B cos θ = C_rr A sin(θ)^(3/2) [deg]."""

    def excess(theta):
        return FIRM.B * math.cos(theta) - 0.5 * FIRM.A * math.sin(theta) ** 1.5

    return math.degrees(scipy.optimize.brentq(excess, 0.0, math.pi / 2, xtol=1e-14))


def test_the_page_shows_the_file_as_it_is():
    assert blocks(PAGE, "python")[0] == (EXAMPLE / "pushfit_hertz.py").read_text()


def test_a_push_four_times_as_deep_takes_eight_times_the_force(own_mechanics):
    theta = np.array([math.asin(0.2), math.asin(0.8), math.pi / 2, 0.0])
    found = forces(
        FIRM.params, Pushes(theta, 0 * theta), Grasp(PUSH, mechanics="hertz")
    )
    np.testing.assert_allclose(found.normal[1], 8 * found.normal[0], rtol=EXACT)
    np.testing.assert_allclose(found.normal[2], FIRM.A * PUSH, rtol=EXACT)
    assert found.normal[3] == 0


def test_a_preload_is_what_the_finger_presses_with_before_the_push(own_mechanics):
    """And as deep again as it is pressed in, the force grows by the power of 3/2."""
    depth = (2.0 / (FIRM.A / math.sqrt(PUSH))) ** (2 / 3)
    theta = np.array([0.0, math.asin(depth / PUSH), -math.pi / 2])
    grasp = Grasp(PUSH, 2.0, mechanics="hertz")
    found = forces(FIRM.params, Pushes(theta, 0 * theta), grasp)
    np.testing.assert_allclose(found.normal[:2], [2.0, 2 * 2**1.5], rtol=EXACT)
    assert list(found.in_contact) == [True, True, depth > PUSH]


def test_the_critical_angle_is_found_from_the_forces_alone(own_mechanics):
    grasp = Grasp(PUSH, mechanics="hertz")
    angle = critical_angle(FIRM.params, grasp, jnp.asarray(0.3))
    np.testing.assert_allclose(np.degrees(angle), true_angle(), rtol=EXACT)


@pytest.mark.slow
def test_the_commands_of_the_page_find_the_truth(own_mechanics, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(EXAMPLE.parent)
    monkeypatch.chdir(tmp_path)
    for arguments in commands(PAGE):
        assert main(arguments) == 0
    found = read_result(Path("hertz_result"))
    summary = json.loads(Path("hertz_result/summary.json").read_text("utf-8"))
    assert summary == summary_dict(found)
    assert found.mechanics == "hertz"
    low, high = found.theta_c.interval
    assert low < true_angle() < high
    assert high - low < NARROW


@pytest.mark.slow
def test_emcee_finds_it_too(own_mechanics):
    table = simulate_table(
        FIRM.params,
        Grasp(PUSH, mechanics="hertz"),
        theta=np.radians(np.arange(10.0, 90.0, 5.0)),
        alpha=0.0,
        repeats=2,
        noise=0.01,
        rng=np.random.default_rng(4),
        channels=("height_normal", "height_tangential"),
        state_sd=True,
    )
    text = OWN + "[parameters]\nK_dn = { fixed = 866.7 }\nL = { fixed = 0.04 }\n"
    both = {
        engine: identify_table(table, config(text), seed=1, engine=engine)
        for engine in ("sweep", "emcee")
    }
    for engine, found in both.items():
        assert found.posterior.engine == engine
        low, high = found.theta_c.interval
        assert low < true_angle() < high
    width = high - low
    gap = both["sweep"].theta_c.estimate - both["emcee"].theta_c.estimate
    assert abs(gap) < MEDIANS * width


def test_other_heights_run_through_the_same_programs(tmp_path, monkeypatch):
    """By default some heights ask for the programs of heavy-tailed noise as well."""
    (tmp_path / "pushfit_counted.py").write_text(COUNTED)
    monkeypatch.syspath_prepend(tmp_path)
    text = '[grasp]\nmechanics = "counted"\n[noise]\nlikelihood = "normal"\n'
    settings = config(text + FRICTION_ONLY)
    traces = sys.modules["pushfit_counted"].TRACES
    counts = []
    try:
        for seed in (1, 2):
            table = simulate_table(
                paper_parameters(),
                Grasp(PUSH),
                theta=np.radians(np.arange(10.0, 90.0, 10.0)),
                alpha=0.0,
                repeats=2,
                noise=0.01,
                rng=np.random.default_rng(seed),
            )
            fit_table(table, settings)
            counts.append(len(traces))
    finally:
        del sys.modules["pushfit_counted"]
        mechanics_named.cache_clear()
    assert counts[0] == counts[1] > 0


def test_traces_are_not_kept_for_a_process_in_which_the_file_may_have_changed(
    own_mechanics, tmp_path, monkeypatch
):
    monkeypatch.setenv(cache.PROGRAMS, str(tmp_path))
    # Of a number that no earlier run had, or JAX itself might have kept the program.
    number = time.time_ns()
    following = compiled(lambda x: x + number)
    following(jnp.arange(3.0))
    mechanics_named("hertz")
    following(jnp.arange(4.0))
    # What was lowered is told apart by itself.
    kept = sorted(path.name.rpartition("-")[2] for path in tmp_path.iterdir())
    assert kept == ["program", "program", "traced"]


class Imported(str):
    """Name of a module during whose comparison another thread imports one."""

    __slots__ = ()

    def startswith(self, *prefix):
        sys.modules["imported_beside"] = sys
        return super().startswith(*prefix)


def test_other_threads_may_import_while_files_are_looked_for(monkeypatch):
    monkeypatch.setattr(sys, "modules", {Imported("one"): sys, **sys.modules})
    assert not has_foreign()


def test_its_rivals_are_those_that_come_with_pushfit(own_mechanics):
    normal = OWN + '[noise]\nlikelihood = "normal"\n'
    text = normal + "[parameters.L]\nfixed = 0.04\n"
    noises = list(NOISES)
    rivals = [
        list(rival_configs(config(one), has_repeats=True)) for one in (text, normal)
    ]
    assert rivals[0][3:] == ["linear", "tilting", *noises]
    assert rivals[1][3:] == ["linear", *noises]


@pytest.mark.parametrize("name", ["rigid", "containers", "linear.py", ""])
def test_mechanics_that_nobody_wrote_are_refused_with_what_to_write(name):
    with pytest.raises(ConfigError, match="finds no module pushfit_"):
        config(f'[grasp]\nmechanics = "{name}"\n')


def test_every_function_of_a_record_is_where_it_says():
    for record in BUILT_IN.values():
        given = [record.forces, record.critical_angle, record.is_tie]
        for function in (*given, *record.ties.values()):
            if isinstance(function, Deferred):
                assert callable(pkgutil.resolve_name(function.place))
