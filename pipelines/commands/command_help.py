"""The application as commands register with it: each has examples at the end of its help, and `--quiet`."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from pipelines.commands.examples import examples_of
from pipelines.report.progress import silenced

F = TypeVar("F", bound=Callable[..., Any])

_VALUE_MAY_BE_LEFT_OUT = ("--install-completion", "--show-completion")
_QUIET = inspect.Parameter(
    "quiet",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, typer.Option("--quiet", help="No progress; errors and results are said.")],
)


def example_lines(context: Any) -> str:
    """Examples of a command as they end its help: each on one line, however long, so that it can be copied."""
    names: list[str] = []
    while context.parent is not None:
        names.insert(0, context.info_name)
        context = context.parent
    shown = examples_of(" ".join(names))
    return "".join(["Examples:\n", *(f"  {example}\n" for example in shown)]) if shown else ""


class Command(TyperCommand):
    """A command with its examples."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help and, as they are, the examples."""
        super().format_help(ctx, formatter)
        formatter.write(example_lines(ctx))


class Commands(TyperGroup):
    """Commands with examples; options of completion need no name of a shell."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help and, as they are, the examples."""
        super().format_help(ctx, formatter)
        formatter.write(example_lines(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the options; of those for completion the shell around is meant where none is named."""
        given = [*args, ""] if args and args[-1] in _VALUE_MAY_BE_LEFT_OUT else args
        return super().parse_args(ctx, given)


class Application(typer.Typer):
    """Registers commands with examples and `--quiet`."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(cls=Commands, **settings)

    def command(self, name: str | None = None, **settings: Any) -> Callable[[F], F]:  # type: ignore[override]
        """Decorator that makes a function a command; the function itself stays as it is."""

        def register(function: F) -> F:
            super(Application, self).command(name, cls=Command, **settings)(_with_quiet(function))
            return function

        return register


def _with_quiet(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def called(*arguments: Any, quiet: bool, **options: Any) -> Any:
        with silenced(quiet):
            return function(*arguments, **options)

    signature = inspect.signature(function, eval_str=True)
    parameters = [*signature.parameters.values(), _QUIET]
    called.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called
