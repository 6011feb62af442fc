"""`grasp.toml`: what is accepted, what is said of what is not, and the template."""

import codecs
import contextlib
import re
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pushfit.config import GraspConfig, parse_config, read_config, template
from pushfit.errors import ConfigError

# The contract that other people's files rely on: every line stays valid.
CONTRACT = """
[push]
length_mm = 5.0
[grasp]
mechanics = "linear"
preload_n = 0.0
support_span_mm = 40.0
[sensor]
counts_per_n = 200.0
[reach]
alpha_deg = [0, 150]
[transition]
sharpness = "hard"
[parameters.L]
fixed = 0.04
[parameters.K_sn]
lognormal = { median = 800.0, sd_log = 0.5 }
"""
# Names that TOML has to quote, and tables in tables.
ODD = """
[peaks]
exclude = [[1.0, 2.5], [1e9, 1.5e9]]
[recording]
map = { "finger tip.x" = "a\\"b" }
[recording.calibration.pressure]
name = "biotac_pdc"
factor = 0.0371
provenance = "dead weights"
"""


def parse(text: str) -> GraspConfig:
    return parse_config(text, path="grasp.toml")


def test_the_published_contract_is_read():
    config = parse(CONTRACT)
    assert config.push.length_mm == 5.0
    assert config.reach.alpha_deg == (0.0, 150.0)
    assert config.parameters.L is not None
    assert config.parameters.L.fixed == 0.04
    assert config.parameters.K_sn is not None
    assert config.parameters.K_sn.lognormal is not None
    assert config.parameters.K_sn.lognormal.sd_log == 0.5


def test_the_template_means_the_same_as_no_file():
    assert parse(template()) == read_config(None)


def test_the_template_of_settings_means_the_same_as_they_do():
    stated = parse(CONTRACT + ODD)
    assert parse(template(stated)) == stated
    # What they leave open is written as for everybody.
    assert template(stated).count("\n#n_per_kpa = 0.137\n") == 1


def test_the_template_names_every_key():
    for name, section in GraspConfig.model_fields.items():
        text = template().split(f"[{name}]\n")[1].split("\n[")[0]
        keys = re.findall(r"^#?(\w+) = ", text, flags=re.MULTILINE)
        assert keys == list(section.default.__class__.model_fields)


def example_lines() -> list[tuple[str, str]]:
    """Each inactive key of the template with its section."""
    found, section = [], ""
    for line in template().splitlines():
        if line.startswith("["):
            section = line
        elif re.match(r"#\w+ = ", line):
            found.append((section, line[1:]))
    return found


# What the priors of unknown numbers of the grasp go with.
NEEDED = {
    "F_0": '[grasp]\npreload_n = "estimate"\n',
    "p": '[transition]\nsharpness = "auto"\n',
}


@pytest.mark.parametrize(("section", "line"), example_lines())
def test_every_example_of_the_template_is_valid(section, line):
    needed = NEEDED.get(line.split()[0], "")
    text = f"{needed}{section}\n{line}\n"
    assert tomllib.loads(text)
    parse(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[push]\nlenght_mm = 5.0", "push.lenght_mm = 5.0: unknown key; did you mean"),
        ("[pushh]", "pushh: unknown key; did you mean push?"),
        ("[push]\nlength_mm = -5", "push.length_mm = -5: must be greater than or"),
        ("[push]\nlength_mm = 0.005", "length_mm = 0.005: must be greater than or"),
        ("[push]\nlength_mm = 5000", "length_mm = 5000: must be less than or"),
        ("[parameters.L]\nfixed = 40", "L: fixed = 40 m is no length in an object"),
        (
            "[parameters.L]\nnormal = { mean = 40, sd = 1 }",
            "mean = 40 m is no length in an object",
        ),
        ("[peaks]\nexclude = [12, 13]", "must be a list of pairs, such as [["),
        ('[push]\nlength_mm = "5"', 'push.length_mm = "5": must be a number'),
        ("[push]\nlength_mm = nan", "push.length_mm = nan: must be a finite number"),
        ("[push]\nlength_mm = true", "push.length_mm = true: must be a number"),
        ("push = 3", "push = 3: must be a table"),
        ("[parameters.Q]\nfixed = 1.0", "parameters.Q: unknown key; known here: K_sn"),
        (
            '[grasp]\npreload_n = "est"',
            "grasp.preload_n = \"est\": must be a number or must be 'estimate'",
        ),
        (
            "[grasp]\npreload_n = 1\npreload_kpa = 1",
            "grasp: preload_n and preload_kpa are given; keep one",
        ),
        (
            "[parameters.K_sn]",
            "parameters.K_sn: give exactly one of fixed, normal, lognormal, uniform, "
            "or leave the whole parameter out",
        ),
        (
            "[parameters.L]\nfixed = 1\nuniform = { low = 0, high = 1 }",
            "parameters.L: give exactly one of fixed, normal, lognormal, uniform, not "
            "fixed and uniform; keep one",
        ),
        (
            "[parameters.L]\nfixed = -1",
            "parameters.L: fixed = -1 must be above 0; give it above 0",
        ),
        (
            "[parameters.L]\nnormal = { mean = -1, sd = 1 }",
            "parameters.L: mean = -1 must be above 0; give it above 0, or a lognormal",
        ),
        (
            "[parameters.L]\nuniform = { low = -1, high = 1 }",
            "parameters.L: low = -1 must not be below 0; give 0 or more",
        ),
        ("[parameters.L]\nnormal = { mean = 1 }", "parameters.L.normal.sd: is missing"),
        (
            "[parameters.e1]\nlognormal = { median = 1, sd_log = 1 }",
            "parameters.e1: lognormal is for positive numbers; use normal",
        ),
        (
            "[parameters.L]\nuniform = { low = 2, high = 1 }",
            "parameters.L.uniform: low = 2 must be below high = 1; give the "
            "lower bound",
        ),
        ("[parameters.F_0]\nfixed = 1", "parameters.F_0 is a prior of an estimated"),
        (
            "[transition]\nsharpness = 4\n"
            "[parameters.p]\nuniform = { low = 1, high = 9 }",
            "parameters.p is a prior of",
        ),
        (
            '[parameters.p]\nfixed = 4\n[transition]\nsharpness = "auto"',
            "set transition.sharpness = 4",
        ),
        (
            '[parameters.F_0]\nfixed = 2\n[grasp]\npreload_n = "estimate"',
            "set grasp.preload_n = 2",
        ),
        ("[push]\nlength_known = true", "length_known = true needs length_mm"),
        ("[transition]\nsharpness = 0.5", "sharpness = 0.5: must be 'hard' or 'auto'"),
        ("[reach]\nalpha_deg = [0]", "reach.alpha_deg = [0]: has too few values"),
        (
            "[peaks]\nexclude = [[9, 0]]",
            "peaks.exclude = [[9, 0]]: [9, 0] ends before it",
        ),
        ("[reach]\nalpha_deg = [9, 0]", "reach: alpha_deg = [9, 0]: give [low, high]"),
        ('[grasp]\nmechanics = "tilting"', "set push.length_mm"),
        ('[grasp]\nmechanics = "rigid"', "mechanics"),
        (
            "[sensor]\nn_per_kpa = 1\nkpa_per_count = 1\ncounts_per_n = 1",
            "follows from the other factors; remove it",
        ),
        (
            "[sensor]\nkpa_per_n = 7.3\nn_per_kpa = 0.137",
            "kpa_per_n follows from the other factors; remove it",
        ),
        (
            "[sensor]\ncounts_per_n = 200.0\nn_per_count = 0.01",
            "counts_per_n = 200 contradicts n_per_count, by which it is 100; find out",
        ),
        (
            "[sensor]\nn_per_kpa = 2\nkpa_per_count = 5\ncounts_per_n = 1",
            "counts_per_n = 1 contradicts n_per_kpa, kpa_per_count, by which it is 0.1",
        ),
        ("[push\n", "not valid TOML:"),
        ("a = 1\na = 2\n", "line 2"),
    ],
)
def test_every_refusal_names_file_key_value_and_rule(text, expected):
    with pytest.raises(ConfigError) as caught:
        parse(text)
    assert str(caught.value).startswith("grasp.toml: ")
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_all_problems_of_a_file_are_reported_at_once():
    with pytest.raises(ConfigError, match=r"length_mm = -1.*\n.*prob = 90") as caught:
        parse("[push]\nlength_mm = -1\n[report]\nprob = 90\n")
    assert [p.column for p in caught.value.problems] == [
        "push.length_mm",
        "report.prob",
    ]


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file"):
        read_config(tmp_path / "none.toml")


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "grasp.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not UTF-8"):
        read_config(tmp_path / "grasp.toml")


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path):
    """Editors of Windows write one."""
    content = codecs.BOM_UTF8 + b"[push]\nlength_mm = 5.0\n"
    (tmp_path / "grasp.toml").write_bytes(content)
    assert read_config(tmp_path / "grasp.toml").push.length_mm == 5.0


def test_factors_chain_from_counts_to_newtons():
    sensor = parse("[sensor]\nkpa_per_count = 0.5\nn_per_kpa = 0.25\n").sensor
    assert sensor.factor("counts", "n") == 0.125
    assert sensor.factor("n", "counts") == 8.0
    assert sensor.factor("n", "n") == 1.0
    assert sensor.factor("n", "au") is None


def test_a_preload_is_converted_into_the_unit_of_the_heights():
    config = parse("[grasp]\npreload_n = 2\n[sensor]\ncounts_per_n = 200\n")
    assert config.preload_in("counts") == 400.0


def test_a_preload_without_a_conversion_is_refused():
    with pytest.raises(ConfigError, match="give preload_counts or add the factor"):
        parse("[grasp]\npreload_n = 2\n").preload_in("counts")


def test_no_preload_is_zero_in_every_unit():
    assert GraspConfig().preload_in("au") == 0.0


def test_an_estimated_preload_stays_a_word():
    assert parse('[grasp]\npreload_kpa = "estimate"').preload_in("n") == "estimate"


def test_a_length_is_known_only_if_it_is_given():
    assert not GraspConfig().push.length_known
    assert parse("[push]\nlength_mm = 5").push.length_known
    assert not parse("[push]\nlength_mm = 5\nlength_known = false").push.length_known


def test_the_digest_sees_values_and_not_their_order():
    ab = parse("[push]\nlength_mm = 5\n[report]\nprob = 0.8\n")
    ba = parse("[report]\nprob = 0.8\n[push]\nlength_mm = 5.0\n")
    assert ab.digest() == ba.digest()
    assert ab.digest() != GraspConfig().digest()


@given(st.text(max_size=60))
def test_any_text_is_a_config_or_a_refusal(text):
    with contextlib.suppress(ConfigError):
        parse(text)


TOML = st.recursive(
    st.one_of(
        st.integers(-5, 500), st.floats(), st.booleans(), st.sampled_from(["hard", "x"])
    ),
    lambda children: st.lists(children, max_size=2),
    max_leaves=3,
)


@given(st.sampled_from(sorted(GraspConfig.model_fields)), st.data())
def test_any_value_of_any_key_is_taken_or_refused(section, data):
    model = GraspConfig.model_fields[section].default.__class__
    key = data.draw(st.sampled_from(sorted(model.model_fields)))
    value = data.draw(TOML)
    text = (
        str(value).replace("'", '"').replace("True", "true").replace("False", "false")
    )
    if text in {"hard", "x"}:
        text = f'"{text}"'
    with contextlib.suppress(ConfigError):
        parse(f"[{section}]\n{key} = {text}\n")


def test_only_the_parameters_that_a_file_names_are_listed():
    config = parse("[parameters]\nL.fixed = 0.04\ne1.fixed = 0.0\n")
    assert [name for name, _ in config.parameters.items()] == ["L", "e1"]
