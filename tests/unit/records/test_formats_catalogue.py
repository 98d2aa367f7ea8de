"""Which format reads a file is found in its content, and never guessed."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import pytest

from sma_bayes.catalogue import Catalogue
from sma_bayes.errors import CampaignError, MeasurementError, UnknownNameError
from sma_bayes.records import formats
from sma_bayes.records.formats import FORMATS, Format, Reading, read_table, recognise
from sma_bayes.records.toml_table import checked


def test_every_file_of_the_folder_that_holds_a_format_is_in_the_table() -> None:
    modules = [
        importlib.import_module(f"{formats.__name__}.{module.name}")
        for module in pkgutil.iter_modules(formats.__path__)
    ]
    held = {m.__name__.rpartition(".")[2]: m.FORMAT for m in modules if hasattr(m, "FORMAT")}
    assert held == {n: f for n, f in FORMATS.items() if f.read.__module__.startswith("sma_bayes.")}


def test_two_formats_that_recognise_a_file_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.csv"
    path.write_text("T,F\n1,2\n3,4\n")
    twin = Format("another text format", lambda path, head: True, FORMATS["delimited"].read, plain=True)
    monkeypatch.setattr(formats, "FORMATS", Catalogue("data format", {**FORMATS, "twin": twin}))
    with pytest.raises(MeasurementError, match="several formats recognise the file: delimited, twin"):
        recognise(path)
    assert read_table(path, Reading(format="twin")).row.tolist() == [2, 3]


def test_a_format_with_a_signature_comes_before_plain_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.csv"
    path.write_text("MAGIC\n1,2\n")
    signed = Format("signed", lambda path, head: head.startswith(b"MAGIC"), FORMATS["delimited"].read)
    monkeypatch.setattr(formats, "FORMATS", Catalogue("data format", {**FORMATS, "signed": signed}))
    assert recognise(path) == "signed"


def test_a_file_of_no_known_format(tmp_path: Path) -> None:
    path = tmp_path / "old.xls"
    path.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(100))
    with pytest.raises(MeasurementError, match="of no format that is known") as caught:
        read_table(path, Reading())
    assert "export it as CSV" in str(caught.value)


def test_an_unknown_name_lists_near_matches(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("1,2\n")
    with pytest.raises(UnknownNameError, match="did you mean 'delimited'"):
        read_table(path, Reading(format="delimted"))


@pytest.mark.parametrize(("content", "found"), [(b"", "is empty"), (b" \r\n\t\n", "has only blank lines")])
def test_an_empty_file(tmp_path: Path, content: bytes, found: str) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    with pytest.raises(MeasurementError, match=found):
        read_table(path, Reading())


def test_a_file_that_cannot_be_opened(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match="can't be read: No such file"):
        read_table(tmp_path / "none.csv", Reading())
    with pytest.raises(MeasurementError, match="can't be read: Is a directory"):
        read_table(tmp_path, Reading())


@pytest.mark.parametrize(
    ("values", "key", "expected"),
    [
        ({"skiprows": 1}, "reading.skiprows", "did you mean 'skip_rows'?"),
        ({"header": "yes"}, "reading.header", "true or false"),
        ({"delimiter": "::"}, "reading.delimiter", "one character, or 'whitespace'"),
        ({"decimal": "'"}, "reading.decimal", "'.' or ','"),
        ({"decimal": ",", "delimiter": ","}, "reading", "a delimiter other than the decimal mark"),
        ({"first_row": 9, "last_row": 3}, "reading", "a first_row that is not after last_row"),
        ({"skip_rows": -1}, "reading.skip_rows", "greater than or equal to 0"),
        ({"missing": "none"}, "reading.missing", "a list: [ ... ]"),
    ],
)
def test_wrong_options_of_reading(values: dict[str, object], key: str, expected: str) -> None:
    with pytest.raises(CampaignError) as caught:
        checked(Reading, values, file=Path("campaign.toml"), where="reading")
    assert (caught.value.column, caught.value.expected) == (key, expected)
