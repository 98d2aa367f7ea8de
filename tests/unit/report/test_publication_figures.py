"""Figures for a paper: their true width and fonts, whatever style is asked for, and nothing else touched."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from sma_bayes.cli import command_line
from sma_bayes.errors import SmaBayesError
from sma_bayes.studies.fit.publication_figures import publication_figures

CONDITION = "100g-10mHz"


def _points(svg: str) -> tuple[float, set[float]]:
    """Width and sizes of letters [pt]: an SVG of matplotlib has a pixel a point."""
    width = re.search(r'width="([\d.]+)pt"', svg)
    assert width is not None
    return float(width[1]), {
        float(size) for size in re.findall(r"font(?:-size)?: (?:[a-z]+ )*([\d.]+)px", svg)
    }


def test_the_width_is_kept_and_fonts_have_the_size_that_the_style_says(
    run_copy: Path, tmp_path: Path
) -> None:
    style = tmp_path / "journal.mplstyle"
    style.write_text(
        "svg.fonttype: none\naxes.labelsize: 6.5\nxtick.labelsize: 6\nytick.labelsize: 6\nlegend.fontsize: 5.5\n"
    )
    before = {p: p.read_bytes() for p in run_copy.rglob("*") if p.is_file()}
    files = publication_figures(run_copy, "85mm", formats=["svg"], style=style)
    target = run_copy / "figures" / "publication"
    assert files == [target / f"loop-{CONDITION}.svg", target / f"loop-{CONDITION}.png"]
    width, fonts = _points(files[0].read_text(encoding="utf-8"))
    assert width == pytest.approx(85.0 / 25.4 * 72.0, abs=1e-3)
    assert fonts == {5.5, 6.0, 6.5}
    assert {p: p.read_bytes() for p in before} == before
    new = {p.name for p in run_copy.rglob("*") if p.is_file() and p not in before}
    assert new == {f"loop-{CONDITION}.{kind}" for kind in ("svg", "png", "csv")}


def test_a_figure_has_no_title_and_names_what_it_shows(run_copy: Path, tmp_path: Path) -> None:
    style = tmp_path / "text.mplstyle"
    style.write_text("svg.fonttype: none\n")
    (svg, _) = publication_figures(run_copy, "3.5 in", formats=["svg"], style=style)
    text = svg.read_text(encoding="utf-8")
    for label in ("force F [N]", "displacement X [cm]", "stiffness K [N/cm]"):
        assert label in text
    assert CONDITION not in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)


@pytest.mark.parametrize(
    ("width", "options", "message"),
    [
        ("2 mm", {}, "--figure-width '2 mm'"),
        ("85", {}, "--figure-width '85' has no unit\nexpected: a width with its unit, such as '85mm'"),
        ("85 mm", {"conditions": ["200g"]}, "no condition '200g'"),
        ("85 mm", {"formats": ["eps"]}, "no format"),
        ("85 mm", {"style": Path("missing.mplstyle")}, "style"),
    ],
)
def test_what_can_not_be_drawn_is_refused_before_anything_is_written(
    run_copy: Path, width: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(SmaBayesError, match=message):
        publication_figures(run_copy, width, **options)  # type: ignore[arg-type]
    assert not (run_copy / "figures").exists()


def test_a_style_with_a_wrong_line_is_told_by_its_name(run_copy: Path, tmp_path: Path) -> None:
    style = tmp_path / "bad.mplstyle"
    style.write_text("font.sise: 7\n")
    with pytest.raises(SmaBayesError, match=r"font\.sise"):
        publication_figures(run_copy, "85 mm", style=style)


def test_one_command_draws_them(run_copy: Path) -> None:
    done = CliRunner().invoke(
        command_line(),
        ["report", str(run_copy), "--figure-width", "85mm", "--condition", CONDITION, "--format", "pdf"],
    )
    assert done.exit_code == 0, done.output
    assert done.output.split()[0].endswith(f"loop-{CONDITION}.pdf")
    assert not (run_copy / "report.html").exists()


@pytest.mark.parametrize("other", [["--figures", "all"], ["--workbook"]])
def test_what_would_not_be_drawn_is_not_ignored(run_copy: Path, other: list[str]) -> None:
    done = CliRunner().invoke(command_line(), ["report", str(run_copy), "--figure-width", "85mm", *other])
    assert isinstance(done.exception, SmaBayesError)
    assert f"--figure-width with {other[0]}" in str(done.exception)
    assert not (run_copy / "figures").exists()
