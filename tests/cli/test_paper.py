"""`sma-bayes paper --page`: what is refused, and that it is refused before anything is fitted."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from sma_bayes.cli import command_line
from sma_bayes.errors import OutputError, SmaBayesError


@pytest.mark.parametrize("more", [["--errata"], ["--table", "3"], ["--format", "csv"], ["--out", "x"]])
def test_a_page_is_written_whole_or_not_asked_for(more: list[str], tmp_path: Path) -> None:
    found = CliRunner().invoke(command_line(), ["paper", "--page", str(tmp_path / "docs"), *more])
    assert isinstance(found.exception, SmaBayesError)
    assert "--page" in str(found.exception)
    assert not (tmp_path / "docs").exists()


def test_a_folder_that_is_a_file_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    found = CliRunner().invoke(command_line(), ["paper", "--page", str(tmp_path / "file")])
    assert isinstance(found.exception, OutputError)
    assert "--page" in str(found.exception)
    assert (tmp_path / "file").read_text(encoding="utf-8") == "mine"
