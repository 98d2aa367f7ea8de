"""The command line: the verbs of the registry, and how a call ends.

Exit status: 0 done, 1 done but not converged, or with --strict not adequate, 2 the input or the call is wrong, 70 a
mistake in this package; 128 and the number of the signal where one ended it, see `sma_bayes.interruption`.
"""

from __future__ import annotations

import re
import sys
import traceback
from functools import cache
from importlib.metadata import entry_points
from inspect import getdoc
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from sma_bayes import __version__
from sma_bayes.errors import SmaBayesError
from sma_bayes.interruption import ending_in_order, interrupted
from sma_bayes.studies.registry import VERBS, command_of

MISTAKE = 70
"""Exit status besides 0, 1 and 2, as sysexits.h has it; `sma_bayes.interruption` has those of signals."""


class VerbGroup(TyperGroup):
    """Verbs of the registry, each made when it is called: the help tells of twenty and needs the options of none."""

    def list_commands(self, ctx: typer.Context) -> list[str]:  # type: ignore[override]
        """Names of the verbs, in the order of the help."""
        return list(VERBS)

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:  # type: ignore[override]
        """The command of a verb; None where there is no such verb, when all are made to tell which one was meant."""
        for verb in [cmd_name] if cmd_name in VERBS else VERBS:
            if verb not in self.commands:
                self.commands[verb] = command_of_verb(verb)
        return self.commands.get(cmd_name)

    def format_commands(self, ctx: typer.Context, formatter: Any) -> None:  # type: ignore[override]
        """What each verb does, in a sentence."""
        told = ((verb, getdoc(command_of(verb)) or "") for verb in VERBS)
        rows = [(verb, text.partition("\n")[0].rstrip(".")) for verb, text in told]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


class VerbCommand(TyperCommand):
    """A verb that refuses an option of one value that is given twice, of which the parser would take the last."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Arguments that are left; the call ends with status 2 where an option stands there too often."""
        if not ctx.resilient_parsing:
            _, _, given = self.make_parser(ctx).parse_args(args=list(args))
            for option in self.get_params(ctx):
                one_value = isinstance(option, TyperOption) and not option.multiple and not option.is_flag
                if one_value and (times := given.count(option)) > 1:
                    ctx.fail(
                        f"Option '{option.opts[0]}' was given {times} times: it takes one value, give it once."
                    )
        return super().parse_args(ctx, args)


def command_of_verb(verb: str) -> Any:
    """Command of a verb, with its options, as the program runs it.

    Raises
    ------
    SmaBayesError
        If another package provides the verb, and it can't be loaded.
    """
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    alone.command(verb, cls=VerbCommand)(command_of(verb))
    return typer.main.get_command(alone)


@cache
def command_line() -> typer.Typer:
    """The program, with a command for each verb."""
    app = typer.Typer(
        name="sma-bayes",
        cls=VerbGroup,
        help="Bayesian stiffness of shape memory alloy springs: posteriors, credible bands, correlation factors.",
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    app.callback()(_common)
    return app


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"sma-bayes {__version__}")
        raise typer.Exit


def _common(
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Common to all verbs."""


def main() -> None:
    """Run the command line, and turn the user's mistakes into one message and exit status 2."""
    try:
        command_line()(prog_name="sma-bayes", standalone_mode=True)
    except Exception as error:
        if interrupted():  # then it follows from that
            raise
        told = error if isinstance(error, SmaBayesError) else _of_the_system(error)
        if told is not None:
            print(f"error: {told}", file=sys.stderr)
            sys.exit(2)
        traceback.print_exc()  # Python's own status for it, 1, would say that the run did not converge
        whose = _package_at_fault(error)
        print(f"error: this is a mistake in {whose}, please report the lines above", file=sys.stderr)
        sys.exit(MISTAKE)


def _package_at_fault(error: Exception) -> str:
    """Innermost package of a traceback, that of a worker if one failed, among this one and those that join it."""
    own = "sma_bayes"
    groups = entry_points()
    joined = {
        point.module.partition(".")[0]
        for group in groups.groups
        if group.startswith(f"{own}.")
        for point in groups.select(group=group)
    }
    lines = "".join(traceback.format_exception(error, chain=False))
    if type(error.__cause__).__name__ == "_RemoteTraceback":  # of joblib and concurrent.futures: text
        lines = str(error.__cause__)
    for file in reversed(re.findall(r'^ *File "(.+)", line \d+', lines, re.MULTILINE)):
        path = Path(file)
        for package in (*joined, own):
            if package in (path.stem, *path.parent.parts):
                return package
    return own


def _of_the_system(error: Exception) -> SmaBayesError | None:
    """What the system could not give: a file that can't be used, or memory."""
    if isinstance(error, MemoryError):
        return SmaBayesError(
            "there is not enough memory" + (f" ({error})" if str(error) else ""),
            expected="room for all data and draws",
            remedy="give less data at a time, a smaller --jobs, or a machine with more memory",
        )
    if isinstance(error, OSError) and error.filename is not None:
        name = str(error.filename)
        return SmaBayesError(
            f"can't be used: {error.strerror}",
            file=name if len(name) <= 200 else f"{name[:100]}...",
            expected="a file or folder that this user may read, or write where results go",
            remedy="check path and permissions",
        )
    return None


if __name__ == "__main__":
    with ending_in_order():
        main()
