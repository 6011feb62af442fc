"""One example of each command and what comes after it, for the end of its --help.

Excluded: what options mean, which stands with them (`pushfit.cli.options`).
"""

EXAMPLES = {
    "validate": (
        "pushfit validate sweep.csv schedule.csv",
        "`pushfit peaks` shows which pushes are found",
    ),
    "peaks": (
        "pushfit peaks sweep.csv -s schedule.csv -o peaks.csv --plot peaks.png",
        "look at the picture, then `pushfit fit peaks.csv`",
    ),
    "look": (
        "pushfit look sweep.csv",
        "click, type, save; it says the `pushfit identify` that comes next",
    ),
    "identify": (
        "pushfit identify sweep.csv -s schedule.csv -c grasp.toml -o result",
        "open result/report.html; `pushfit verify result` computes it again",
    ),
    "fit": (
        "pushfit fit peaks.csv -c grasp.toml",
        "add -o result for figures and a page",
    ),
    "sample": (
        "pushfit sample peaks.csv -c grasp.toml -o result",
        "open result/report.html",
    ),
    "batch": (
        "pushfit batch runs/ -c grasp.toml -o results",
        "open results/report.html; the same command does what is new",
    ),
    "watch": (
        "pushfit watch runs/ -c grasp.toml -o results",
        "open results/report.html and load it again when something has come",
    ),
    "simulate": (
        "pushfit simulate schedule.csv -c truth.toml --unit kpa --noise 0.1 "
        "-o simulated.csv",
        "`pushfit identify simulated.csv -s schedule.csv -c grasp.toml`",
    ),
    "demo": ("pushfit demo -o demo_result", "open demo_result/report.html"),
    "init": (
        "pushfit init grasp.toml",
        "set push.length_mm, then give the file by --config",
    ),
    "report": ("pushfit report result -o report.html", "open report.html"),
    "verify": (
        "pushfit verify result",
        "exit code 0 says that every number is the same",
    ),
    "coverage": (
        "pushfit coverage peaks.csv -c grasp.toml --tables 40 --plot coverage.png",
        "a claim outside its limits is not to be relied on",
    ),
    "calibrate": (
        "pushfit calibrate peaks.csv -c grasp.toml",
        "use `pushfit coverage`, its name from now on",
    ),
    "compare": (
        "pushfit compare peaks.csv -c grasp.toml",
        "state the model that is preferred in grasp.toml",
    ),
    "diff": (
        "pushfit diff before after --plot diff.png",
        "open diff.png; a difference whose interval holds 0 is not clear",
    ),
    "next": (
        "pushfit next peaks.csv -c grasp.toml --plot next.png",
        "make the first push of the list, add its height to the table, ask again",
    ),
    "explore": (
        "pushfit explore --hand simulated -c grasp.toml --sigma 0.1 --out explored",
        "open explored/report.html: what was found and how it went",
    ),
    "doctor": ("pushfit doctor", "give what it prints along with a report of a bug"),
}


def epilog(name: str) -> str | None:
    """End of the help of a command."""
    if name not in EXAMPLES:
        return None
    example, after = EXAMPLES[name]
    # The first character keeps the lines as they are.
    return f"\b\nExample:\n  {example}\nThen: {after}"
