"""The verb `modulus` on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from sma_bayes.studies import command_options as opt
from sma_bayes.studies.command_execution import calls


@calls("modulus", "show_modulus")
def command(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...", help="Exports of dynamic mechanical analysis of one material: text or XLSX."
        ),
    ],
    out: opt.Out,
    at: Annotated[
        list[str] | None,
        typer.Option(help="A temperature, such as '60 degC', at which to tell moduli; may be repeated."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            help="QUANTITY=NAME of a column that is not known by its name; quantities: temperature, storage_modulus, "
            "loss_modulus, tan_delta, frequency, time. May be repeated.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(help="QUANTITY=UNIT of a quantity whose unit the files do not state; may be repeated."),
    ] = None,
    frequency: Annotated[str, typer.Option(help="Frequency, such as '1 Hz', of files without any.")] = "",
    encoding: Annotated[str | None, typer.Option(help="Encoding of text files.")] = None,
    model: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Response model of the storage modulus; 'auto': the best supported."
        ),
    ] = "auto",
    loss_model: Annotated[
        str,
        typer.Option(metavar="NAME", help="Response model of the loss modulus; 'auto': the best supported."),
    ] = "auto",
) -> dict[str, Any]:
    """Fit storage and loss modulus against temperature, and tell how they shift with frequency (DMTA)."""
    return {
        "column": None,
        "unit": None,
        "columns": _pairs("--column", column or ()),
        "units": _pairs("--unit", unit or ()),
    }


def _pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    from sma_bayes.errors import SmaBayesError

    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise SmaBayesError(
                f"{option} {text!r}", expected="QUANTITY=VALUE, such as 'storage_modulus=MPa'"
            )
        pairs[name.strip()] = value.strip()
    return pairs
