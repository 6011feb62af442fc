"""What all commands share: messages, exit codes, and the options that steer them.

Data go to standard output and nothing else does; messages go to standard error, with
colour only on a terminal. An error is one line, a traceback only under --debug.
Excluded: options of some commands only (`pushfit.cli.options`).
"""

import functools
import inspect
import json
import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pushfit.cli.examples import epilog
from pushfit.cli.progress import ProgressLines, shown_bar
from pushfit.cli.stop import say_kept, what_is_kept
from pushfit.cli.wording import flags_of, in_options
from pushfit.data.text.files import existing_files
from pushfit.errors import ConfigError, PushfitError, SettingsError, placed_in
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.report.store.output_folder import refuse_inputs, refuse_twice

if TYPE_CHECKING:
    from pushfit.fit.results import ResultWarning

# Exit codes, beside those of the errors; as a shell has them, 128 + SIGINT and SIGPIPE.
BUG, CANNOT_WRITE, INTERRUPTED, CLOSED_PIPE = 1, 2, 130, 141
# Arguments and options that name files to read. Loading what reads them takes seconds.
SETTINGS = ("profile", "config")
INPUTS = (
    *("recordings", "recording", "table", "files", "folder"),
    *("schedules", "schedule", *SETTINGS),
)
# Folders of results, which are not read like files; and what is written by --force.
RESULTS = ("result", "first", "second")
OUTPUTS = ("out", "output", "plot", "export")
# Replaced without --force as well.
KEPT_UP = ("checkpoint",)
# XLA logs as an error that a program takes minutes to compile. Failures are raised.
XLA_LOG, NOTHING_BUT_FATAL = "TF_CPP_MIN_LOG_LEVEL", "3"
ERROR_SCHEMA = "pushfit.error/1"

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Only errors on stderr.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Say what is done.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandSession:
    """One run of one command; `flags` are its options by the names of arguments."""

    is_quiet: bool
    is_verbose: bool
    is_debug: bool
    is_json: bool
    flags: Mapping[str, str] = field(default_factory=dict)

    def worded(self, text: str) -> str:
        """What the library says, in the options of this command."""
        return in_options(text, self.flags)

    def say(self, text: str, *, style: str = "") -> None:
        """Show a message in a style of rich, unless the user wants quiet."""
        if not self.is_quiet:
            _print_message(self.worded(text), style)

    def wrote(self, path: Path, remark: str = "") -> None:
        """Show that a file or folder is complete."""
        say_kept(f"{path} is complete")
        self.say(f"wrote {path}{remark}")

    def complain(self, text: str) -> None:
        """Show what is wrong, also to a user who wants quiet."""
        _print_message(f"error: {self.worded(text)}", "bold red")

    def warn(self, text: str) -> None:
        """Show what the user may choose to ignore."""
        self.say(f"warning: {text}", style="yellow")

    def warn_of(self, warnings: Iterable["ResultWarning"]) -> None:
        """Show warnings of results with their codes."""
        for warning in warnings:
            self.warn(f"{warning.text} [{warning.code}]")

    def say_more(self, text: str) -> None:
        """Show a message that only --verbose asks for."""
        if self.is_verbose:
            self.say(text, style="dim")

    def answer(self, found: str | Mapping[str, object]) -> None:
        """Write to standard output what was found: words, or the document of --json."""
        if not isinstance(found, str):
            found = json.dumps(found, ensure_ascii=False, allow_nan=False, indent=2)
        print(found)

    def print_failure(
        self, status: str, message: str, *, problems: Sequence[str] = ()
    ) -> None:
        """Write the document of --json where there is no other."""
        self.answer(
            {
                "schema": ERROR_SCHEMA,
                "status": status,
                "message": message,
                "problems": list(problems),
            }
        )

    @contextmanager
    def progress(self) -> Iterator[ProgressLines]:
        """Show how far the work is, as a bar on a terminal, else line by line.

        Yields:
            What to call with the stage of the work and the share of it done.
        """
        if self.is_quiet or not sys.stderr.isatty():
            yield ProgressLines(self.say)
            return
        with shown_bar() as bar:
            yield bar

    def run(self, work: Callable[[], int | None]) -> int:
        """Do the work of a command and turn what goes wrong into an exit code."""
        try:
            code = self._ended(work)
            sys.stdout.flush()
        except BrokenPipeError:
            return say_no_more()
        return code

    def _ended(self, work: Callable[[], int | None]) -> int:
        """The exit code of what is done, said or not."""
        # Libraries log what concerns nobody here; --debug shows that, too.
        logging.basicConfig(level=logging.DEBUG if self.is_debug else logging.ERROR)
        if self.is_verbose:
            logging.getLogger("pushfit").setLevel(logging.INFO)
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda text, *_, **__: self.warn(str(text))
                return work() or 0
        except PushfitError as error:
            self._report(str(error), error)
            return error.exit_code
        except KeyboardInterrupt:
            _print_message(f"interrupted; {what_is_kept()}", "yellow")
            return INTERRUPTED
        except BrokenPipeError:
            raise
        except OSError as error:
            what = f"{error.filename or 'output'}: {error.strerror or error}"
            self._report(f"{what}; {what_is_kept()}", error)
            return CANNOT_WRITE
        except Exception as error:  # the border: every other failure is ours
            if (wrong := _wrong_environment()) is not None:
                self._report(str(wrong), wrong)
                return wrong.exit_code
            name = type(error).__name__
            self._report(f"this is a bug ({name}: {error}); --debug says more", error)
            return BUG

    def _report(self, message: str, error: Exception) -> None:
        """One line on standard error, and a document where one was promised."""
        if self.is_debug:
            raise error
        self.complain(message)
        if self.is_json:
            problems = getattr(error, "problems", ())
            self.print_failure(
                getattr(error, "code", "bug"),
                self.worded(message),
                problems=[self.worded(one.message) for one in problems],
            )


def say_no_more() -> int:
    """Exit code where the reader, for example `head`, has seen enough."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(nowhere, stream.fileno())
    return CLOSED_PIPE


def command(
    app: typer.Typer, name: str | None = None, *, help: str | None = None
) -> Callable[[Callable[..., int | None]], Callable[..., int | None]]:
    """Register a function as a command that also takes --quiet, --verbose and --debug.

    A parameter that is a dataclass is a group of options, one for each field.

    Args:
        name: Name of the command, if not that of the function.
        help: What it does, if not in the words of the function.

    Returns:
        Decorator. The function gets the session first and may return an exit code.
    """

    def register(function: Callable[..., int | None]) -> Callable[..., int | None]:
        _, *own = inspect.signature(function).parameters.values()

        @functools.wraps(function)
        def start(
            *, quiet: bool, verbose: bool, debug: bool, **arguments: object
        ) -> None:
            session = CommandSession(
                is_quiet=quiet,
                is_verbose=verbose,
                is_debug=debug,
                is_json=bool(arguments.get("json")),
                flags=flags_of(parameters),
            )

            def work() -> int | None:
                inputs = _paths(arguments, INPUTS)
                # Said at once, before what reads them is loaded.
                existing_files(inputs)
                outputs = _paths(arguments, KEPT_UP)
                refuse_twice([*outputs, *_paths(arguments, OUTPUTS)])
                if arguments.get("force"):
                    inputs += _paths(arguments, RESULTS)
                    outputs += _paths(arguments, OUTPUTS)
                refuse_inputs(outputs, inputs)
                # Before JAX is imported, which reads the settings once.
                if not debug:
                    os.environ.setdefault(XLA_LOG, NOTHING_BUT_FATAL)
                settings = " and ".join(map(str, _paths(arguments, SETTINGS)))
                session.say_more(f"compiled programs: {enable_compile_cache()}")
                with placed_in(settings, only=SettingsError):
                    return function(session, **_grouped(own, arguments))

            raise typer.Exit(session.run(work))

        shared = {"quiet": Quiet, "verbose": Verbose, "debug": Debug}
        parameters = [option for parameter in own for option in _options(parameter)]
        parameters += [_option(name, kind, False) for name, kind in shared.items()]
        start.__signature__ = inspect.Signature(parameters)  # pyright: ignore
        start.__annotations__ = {p.name: p.annotation for p in parameters}
        word = name or function.__name__
        app.command(name, help=help, epilog=epilog(word))(start)
        return function

    return register


def _option(name: str, kind: object, default: object) -> Parameter:
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _options(parameter: Parameter) -> list[Parameter]:
    """The options of a group, or the parameter itself."""
    group = parameter.annotation
    if not is_dataclass(group):
        return [parameter.replace(kind=Parameter.KEYWORD_ONLY)]
    return [
        _option(f.name, f.type, Parameter.empty if f.default is MISSING else f.default)
        for f in fields(group)
    ]


def _grouped(
    parameters: Sequence[Parameter], given: Mapping[str, object]
) -> dict[str, object]:
    """What was given by option, as the parameters of a command take it."""
    arguments = {}
    for parameter in parameters:
        own = {option.name: given[option.name] for option in _options(parameter)}
        is_group = is_dataclass(parameter.annotation)
        value = parameter.annotation(**own) if is_group else own[parameter.name]
        arguments[parameter.name] = value
    return arguments


def _paths(arguments: Mapping[str, object], names: Iterable[str]) -> list[Path]:
    """Paths that were given under some names."""
    given = [arguments.get(name) for name in names]
    several = [one if isinstance(one, list) else [one] for one in given]
    return [path for one in several for path in one if isinstance(path, Path)]


def _wrong_environment() -> ConfigError | None:
    """Why JAX, where it is loaded, cannot compute at all."""
    if "jax" not in sys.modules:
        return None
    from pushfit.fit.programs.devices import check_devices

    try:
        check_devices()
    except ConfigError as error:
        return error
    return None


def _print_message(text: str, style: str) -> None:
    """One message on standard error; whatever came from files cannot steer it."""
    from rich.console import Console
    from rich.text import Text

    from pushfit.report.strings import printable

    console = Console(stderr=True, soft_wrap=True)
    try:
        console.print(Text(printable(text), style=style))
    except SystemExit as gone:  # what rich makes of a reader that has gone
        raise BrokenPipeError from gone
