"""`pushfit next` and `pushfit explore`, from the command line."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest

from pushfit.cli.app import main
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable, read_table, write_table
from pushfit.explore.hands.protocol import PushOutcome, PushStatus
from pushfit.explore.hands.simulated import SimulatedHand
from pushfit.model import Grasp
from pushfit.report.answers import ANSWERS
from pushfit.report.store.read import read_result
from tests.explore.worlds import COMPONENTS, SIGMA, TRUTH, TRUTH_FILE
from tests.fit.tables import HARD, TOML
from tests.tolerances import EXACT

EXPLORE = ("--forces", "--sigma", "0.05", "--budget", "2", "--noise", "0.01")
EXPLORE += ("--theta", "10", "80")


@pytest.fixture
def grasp(tmp_path):
    path = tmp_path / "grasp.toml"
    path.write_text("[push]\nlength_mm = 5.0\n")
    return path


@pytest.fixture
def hard_grasp(grasp):
    """The switch of the paper: programs that other tests have of noise that is open."""
    grasp.write_text(TOML + HARD)
    return grasp


@pytest.fixture
def truth(tmp_path):
    path = tmp_path / "truth.toml"
    path.write_text(TRUTH_FILE)
    return path


def pushed(theta_deg, *, noise, channels=COMPONENTS, **options):
    """A push of 5 mm at each elevation, on the grasp that is known."""
    return simulate_table(
        TRUTH,
        Grasp(push_length=0.005),
        theta=np.radians(theta_deg),
        alpha=np.pi / 2,
        repeats=1,
        noise=noise,
        rng=np.random.default_rng(1),
        channels=channels,
        **options,
    )


@pytest.mark.slow
def test_next_ranks_pushes_after_a_table(tmp_path, grasp, capsys):
    table = pushed([20.0, 65.0], noise=SIGMA, state_sd=True)
    peaks, plot = tmp_path / "peaks.csv", tmp_path / "next.png"
    write_table(table, peaks)
    command = ["next", str(peaks), "--config", str(grasp)]
    assert main([*command, "--json", "--plot", str(plot), "-n", "3"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "pushfit.next/1"
    assert found["status"] == "deciding"
    assert found["n_pushes"] == 2
    gains = [push["gain_nat"] for push in found["suggestions"]]
    assert len(gains) == 3
    assert gains == sorted(gains, reverse=True)
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("factor", "code"), [(1.0, 0), (1.3, 3)])
def test_one_height_that_no_grasp_gives_is_said(factor, code, tmp_path, grasp, capsys):
    """Also where nothing is decided: 0.1° never is."""
    table = pushed([10.0, 25.0, 40.0, 55.0, 70.0, 82.0], noise=0.01)
    frame = table.frame.copy()
    frame.loc[1, [f"{name}_n" for name in COMPONENTS]] *= factor
    write_table(type(table).from_frame(frame), tmp_path / "peaks.csv")
    words = [str(tmp_path / "peaks.csv"), "--config", str(grasp), "--sigma", "0.01"]
    assert main(["next", *words, "--width", "0.1"]) == code
    said = capsys.readouterr().out
    assert ("no grasp gives all of these heights: push 2 " in said) is (code == 3)


@pytest.mark.parametrize(("factor", "code"), [(1.0, 0), (1.3, 3)])
def test_one_height_unlike_the_others_is_said_without_a_noise(
    factor, code, tmp_path, hard_grasp, capsys
):
    """One in 1000 tables is faulted falsely; this one is off by 16 times its noise."""
    table = pushed(np.linspace(10.0, 80.0, 8), noise=0.02, channels=("height",))
    frame = table.frame.copy()
    frame.loc[5, "height_n"] *= factor
    write_table(type(table).from_frame(frame), tmp_path / "peaks.csv")
    words = [str(tmp_path / "peaks.csv"), "--config", str(hard_grasp), "--width", "0.1"]
    assert main(["next", *words]) == code
    said = " ".join(capsys.readouterr().out.split())
    height = f"{frame['height_n'][5]:.3g}"
    words = f"push 6 (θ = 60.0°, α = 90.0°) has height_n = {height} where the others"
    assert (f"no grasp gives all of these heights: {words}" in said) is (code == 3)


def next_after(frame, folder, grasp, *, width):
    """Exit code of `next` after the pushes of a frame."""
    path = folder / "peaks.csv"
    write_table(PeakTable.from_frame(frame), path)
    return main(["next", str(path), "--config", str(grasp), "--width", str(width)])


@pytest.mark.parametrize(("sign", "code"), [(1.0, 0), (-1.0, 3)])
def test_of_heights_of_inverted_sign_nothing_is_said_but_the_cure(
    sign, code, tmp_path, hard_grasp, capsys
):
    table = pushed(np.linspace(10.0, 80.0, 24), noise=0.02, channels=("height",))
    frame = table.frame.copy()
    frame["height_n"] *= sign
    assert next_after(frame, tmp_path, hard_grasp, width=90) == code
    said = capsys.readouterr()
    assert ("θ_c in " in said.out) is (code == 0)
    assert ("take heights again with peaks.invert = true" in said.err) is (code == 3)


def test_a_column_that_is_not_used_is_said(tmp_path, hard_grasp, capsys):
    table = pushed(np.linspace(10.0, 80.0, 24), noise=0.02, channels=("height",))
    path = tmp_path / "peaks.csv"
    table.frame.assign(preload_n=2.0).to_csv(path, index=False)
    assert main(["next", str(path), "--config", str(hard_grasp), "--width", "90"]) == 0
    assert "column preload_n is not used" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(("wave", "code"), [(0.0, 0), (0.1, 3)])
def test_nothing_is_decided_by_a_model_that_is_not_that_of_the_heights(
    wave, code, tmp_path, hard_grasp, capsys
):
    """Heights that go up and down with θ, without a noise that says how far."""
    theta = np.linspace(10.0, 80.0, 24)
    table = pushed(theta, noise=0.01)
    frame = table.frame.copy()
    frame["height_normal_n"] *= 1 + wave * np.sin(np.radians(9 * theta))
    assert next_after(frame, tmp_path, hard_grasp, width=40) == code
    said = capsys.readouterr()
    assert ("θ_c decided to ± 20°" in said.out) is (code == 0)
    assert ("the model does not describe" in said.out) is (code == 3)
    assert ("[model_inadequate]" in said.err) is (code == 3)


def test_limits_that_allow_no_push_have_an_exit_code(grasp, capsys):
    words = ["--config", str(grasp), "--sigma", "0.05", "--max-force", "1e-6"]
    assert main(["next", *words]) == 2
    assert "give a force limit of 0.05 or more" in capsys.readouterr().out


def test_next_plans_the_first_push_of_all(grasp, capsys):
    assert main(["next", "--config", str(grasp), "--sigma", "0.05"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("after 0 pushes θ_c in ")
    # ± 3° and 60 pushes by default.
    assert "± 3° is asked, with the 60 pushes that are left" in " ".join(out.split())
    assert "theta_deg" in out


def test_the_first_push_is_planned_for_the_sensor_that_there_is(grasp, capsys):
    """Components of a force tell more of θ_c than its magnitude."""
    command = ["next", "--config", str(grasp), "--sigma", "0.05", "--json", "-n", "1"]
    found = []
    for option, settings in (("", ""), ("--forces", ""), ("", '[peaks]\nnormal="-fz"')):
        grasp.write_text(f"[push]\nlength_mm = 5.0\n{settings}\n")
        assert main([*command, *option.split()]) == 0
        found.append(json.loads(capsys.readouterr().out))
    magnitude, by_option, by_settings = found
    assert by_option == by_settings
    gains = [each["suggestions"][0]["gain_nat"] for each in (magnitude, by_option)]
    assert gains[1] > 1.5 * gains[0]


def test_a_simulated_sensor_is_mounted_as_the_settings_say(grasp, tmp_path, capsys):
    grasp.write_text('[push]\nlength_mm = 5.0\n[peaks]\nnormal = "-Fn"\n')
    out = str(tmp_path / "run")
    words = ["--hand", "simulated", "--config", str(grasp), "--out", out]
    assert main(["explore", *words, "--sigma", "0.05"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "normal = '-Fn' is no channel of the simulated sensor" in said


@pytest.mark.parametrize("command", ["next", "explore --hand simulated --out run"])
def test_a_budget_of_no_push_is_refused(command, capsys):
    assert main([*command.split(), "--budget", "0"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "--budget" in said
    assert "greater than or equal to 1" in said


def test_next_keeps_to_the_box_of_the_file(grasp, capsys):
    """z = 5 mm sin θ within 2.6 mm: θ up to 31.3°."""
    box = "workspace_mm = [[-5.0, 5.0], [-5.0, 5.0], [0.0, 2.6]]"
    grasp.write_text(f"{grasp.read_text()}[explore]\n{box}\n")
    words = ["--config", str(grasp), "--sigma", "0.05", "--json", "-n", "20"]
    assert main(["next", *words]) == 0
    pushes = json.loads(capsys.readouterr().out)["suggestions"]
    theta = sorted(push["theta_deg"] for push in pushes)
    np.testing.assert_allclose(theta, np.arange(5.0, 31.0, 5.0), rtol=EXACT)


@pytest.mark.parametrize(
    ("option", "ends"), [("", (-20.0, 40.0)), ("--theta 50 60", (50.0, 60.0))]
)
def test_next_keeps_to_the_elevations_of_the_file_or_of_the_option(
    option, ends, grasp, capsys
):
    grasp.write_text(f"{grasp.read_text()}[reach]\ntheta_deg = [-20, 40]\n")
    words = ["--config", str(grasp), "--sigma", "0.05", "--json", "-n", "20"]
    assert main(["next", *words, *option.split()]) == 0
    pushes = json.loads(capsys.readouterr().out)["suggestions"]
    theta = [push["theta_deg"] for push in pushes]
    np.testing.assert_allclose((min(theta), max(theta)), ends, rtol=EXACT)


@pytest.mark.slow
def test_explore_ends_with_a_result_folder(tmp_path, grasp, truth, capsys):
    out = tmp_path / "run"
    command = [sys.executable, "-m", "pushfit", "explore", "--hand", "simulated"]
    command += ["--config", str(grasp), "--truth", str(truth), "--out", str(out)]
    printed = subprocess.run(
        [*command, *EXPLORE, "--json"], capture_output=True, text=True
    )
    assert printed.returncode == 0, printed.stderr
    summary = json.loads(printed.stdout)
    assert summary["exploration"]["status"] == "out_of_budget"
    assert "adaptive_pushes" in [w["code"] for w in summary["warnings"]]
    assert printed.stderr.count("push 1: θ = ") == 1
    assert read_table(out / "peaks.csv").n_pushes == 2
    result = read_result(out)
    assert result.theta_c.sets
    # The simulated hand's joints miss by up to half a degree.
    assert result.config.noise.theta_sd_deg == pytest.approx(
        0.5 / np.sqrt(3), rel=EXACT
    )
    events = [json.loads(x) for x in (out / "journal.jsonl").read_text().splitlines()]
    assert [e["event"] for e in events].count("told") == 2
    assert result.config.reach.theta_deg == (10.0, 80.0)
    # Which its settings say, so that its table is identified as it was.
    again = [str(out / "peaks.csv"), "--config", str(out / "settings.toml")]
    assert main(["fit", *again, "--json"]) == 0
    fitted = json.loads(capsys.readouterr().out)
    assert fitted["theta_c_deg"] == summary["theta_c_deg"]
    assert fitted["config"] == summary["config"]
    assert main(["verify", str(out)]) == 2
    assert f"--config {out / 'settings.toml'} --seed 0" in " ".join(
        capsys.readouterr().err.split()
    )
    assert (out / "exploration.png").exists()
    assert "The exploration: what is known" in (out / "report.html").read_text()
    assert main(["report", str(out)]) == 0
    assert capsys.readouterr().out == (out / "report.html").read_text()
    # The journal beside the folder is gone: nothing is left to go on with.
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "grasp.toml",
        "run",
        "truth.toml",
    ]
    assert subprocess.run(command, capture_output=True).returncode == 2
    again = subprocess.run(
        [*command, *EXPLORE, "--force"], capture_output=True, text=True
    )
    sentence, *_ = again.stdout.splitlines()
    assert (again.stdout + again.stderr).count(sentence) == 1
    # The last word has the table's identification, which read_result returns.
    *_, last = again.stdout.splitlines()
    told = ANSWERS["theta_c"](read_result(out)).sentence
    assert last == f"Identified from all pushes: {told}"


@pytest.mark.slow
@pytest.mark.parametrize("last", ["told", "asked"])
def test_a_killed_exploration_ends_as_it_would_have(tmp_path, grasp, truth, last):
    """Killed after the second push, or during the third: the same table to the bit."""

    def begun(name):
        command = [sys.executable, "-m", "pushfit", "explore", "--hand", "simulated"]
        command += ["--config", str(grasp), "--truth", str(truth), *EXPLORE]
        command += ["--budget", "4", "--out", str(tmp_path / name)]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def finished(name):
        process = begun(name)
        out, _ = process.communicate()
        assert process.returncode == 0
        return out, (tmp_path / name / "peaks.csv").read_bytes()

    journal = tmp_path / "cut.journal.jsonl"
    killed = begun("cut")
    wanted = 2 if last == "told" else 3
    while not (journal.exists() and counted(journal, last) == wanted):
        time.sleep(0.005)
    killed.kill()
    killed.communicate()
    assert counted(journal, "told") == 2
    assert finished("cut") == finished("whole")


def counted(journal, event):
    """How often an event stands in a journal that is written meanwhile."""
    return journal.read_text().count(f'{{"event": "{event}"')


def test_a_hand_reaches_what_the_settings_say_unless_its_grasp_says_otherwise(
    tmp_path, truth, monkeypatch, capsys
):
    """By limits that fail a journal is of no use: that of others is begun anew."""
    monkeypatch.setattr(SimulatedHand, "push", stalled)
    grasp = tmp_path / "wide.toml"
    wide = "[reach]\ntheta_deg = [-20, 40]\nalpha_deg = [100, 260]\n"
    grasp.write_text(f"[push]\nlength_mm = 5.0\n{wide}")
    for name, own, reason, advice in (
        ("a", "", "stalled", "the same command goes on; for other limits remove"),
        ("b", "[reach]\nalpha_deg = [90, 120]\n", "out_of_reach", "a narrower reach"),
    ):
        truth.write_text(TRUTH_FILE + own)
        words = ["--config", str(grasp), "--truth", str(truth), "--sigma", "0.05"]
        out = str(tmp_path / name)
        assert main(["explore", "--hand", "simulated", *words, "--out", out]) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert f"3 pushes failed in a row: {reason} at θ = -10.0°, α = 180.0°" in said
        assert advice in said


@pytest.mark.parametrize("command", ["next", "explore"])
@pytest.mark.parametrize("preload", ["preload_kpa = 2.0", ""])
def test_a_unit_that_the_preload_is_not_in_is_refused_with_the_one_that_it_is(
    command, preload, tmp_path, capsys
):
    """Without --truth the preload of the example is in kilopascals, too."""
    grasp, out = tmp_path / "grasp.toml", tmp_path / "run"
    grasp.write_text(f"[push]\nlength_mm = 5.0\n[grasp]\n{preload}\n")
    words = ["--config", str(grasp), "--unit", "n", "--sigma", "0.1"]
    if command == "explore":
        words += ["--hand", "simulated", "--out", str(out)]
    is_refused = bool(preload) or command == "explore"
    assert main([command, *words]) == (2 if is_refused else 0)
    said = capsys.readouterr().err
    assert ("add the factor to [sensor], or --unit kpa for" in said) is is_refused


def test_without_a_word_a_hand_explores_the_example_by_what_is_known_of_it(
    tmp_path, monkeypatch, capsys
):
    """Whose preload is stated in kilopascals."""
    monkeypatch.setattr(SimulatedHand, "push", stalled)
    out = tmp_path / "run"
    assert main(["explore", "--hand", "simulated", "--out", str(out)]) == 2
    assert "3 pushes failed in a row: stalled" in capsys.readouterr().err
    start, *_ = (tmp_path / "run.journal.jsonl").read_text().splitlines()
    begun = json.loads(start)
    assert '"unit": "kpa"' in start
    assert '"preload_kpa": 12.0' in json.dumps(begun["config"])


@pytest.mark.parametrize(
    "command",
    [
        ["explore", "--hand", "simulated", "--truth"],
        ["simulate", "plan.csv", "--config"],
    ],
)
def test_a_simulation_names_the_file_that_does_not_state_its_grasp(
    command, tmp_path, grasp, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.csv").write_text("theta_deg,alpha_deg\n10,90\n20,90\n")
    assert main([*command, str(grasp), "--out", "run"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"error: {grasp}: [parameters] says nothing about" in said


def test_failures_leave_a_journal_to_go_on_with(
    tmp_path, grasp, truth, monkeypatch, capsys
):
    """Without a push there is no result, and the next step is said."""
    monkeypatch.setattr(SimulatedHand, "push", stalled)
    out = tmp_path / "run"
    words = ["--config", str(grasp), "--truth", str(truth), "--out", str(out)]
    assert main(["explore", "--hand", "simulated", *words, *EXPLORE]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "3 pushes failed in a row: stalled at θ = " in said
    assert "put it right, and the same command goes on" in said
    # What makes any answer wrong is said before the first push.
    assert said.index("[preload_unknown]") < said.index("push 1")
    assert counted(tmp_path / "run.journal.jsonl", "stopped") == 1


def test_a_journal_goes_on_with_the_simulated_grasp_that_it_began_with(
    tmp_path, grasp, truth, monkeypatch, capsys
):
    monkeypatch.setattr(SimulatedHand, "push", stalled)
    words = ["--config", str(grasp), "--truth", str(truth), *EXPLORE]
    command = ["explore", "--hand", "simulated", *words, "--out", str(tmp_path / "run")]
    assert main(command) == 2
    journal = tmp_path / "run.journal.jsonl"
    before = journal.read_bytes()
    truth.write_text(TRUTH_FILE.replace("800.0", "900.0"))
    capsys.readouterr()
    assert main([*command, "--noise", "0.02"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "hand.noise = 0.01, not 0.02" in said
    assert "hand.truth.parameters.K_sn.fixed = 800.0, not 900.0" in said
    assert "go on with the same, or begin another journal" in said
    assert journal.read_bytes() == before
    # Of an older journal nobody knows the hand.
    text = before.decode()
    start, *rest = text.splitlines(keepends=True)
    event = {k: v for k, v in json.loads(start).items() if k != "hand"}
    journal.write_text("".join([json.dumps(event) + "\n", *rest]))
    assert main(command) == 2
    assert "going on with" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_what_failures_stopped_is_written_and_goes_on(
    tmp_path, grasp, truth, monkeypatch, capsys
):
    out, journal = tmp_path / "run", tmp_path / "run.journal.jsonl"
    words = ["--config", str(grasp), "--truth", str(truth), "--out", str(out)]
    command = ["explore", "--hand", "simulated", *words, *EXPLORE, "--budget", "4"]
    with monkeypatch.context() as broken:
        push = SimulatedHand.push
        broken.setattr(
            SimulatedHand,
            "push",
            lambda self, displacement, *, max_force: (
                push if self.n_pushes < 2 else stalled
            )(self, displacement, max_force=max_force),
        )
        assert main(command) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "put it right, and the same command with --force goes on" in said
    assert read_table(out / "peaks.csv").n_pushes == 2
    assert journal.exists()
    assert main([*command, "--force"]) == 0
    assert read_table(out / "peaks.csv").n_pushes == 4
    assert not journal.exists()


def stalled(self, displacement, *, max_force):
    """As a finger that does not move."""
    return PushOutcome(
        status=PushStatus.STALLED,
        reached=np.zeros(3),
        t_start=self.clock,
        t_end=self.clock,
    )
