"""What `init --json` prints."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field

from sma_bayes.runs.schema import DocumentPart, Items


class StartDocument(DocumentPart):
    """What `sma-bayes init FOLDER --json` prints; it writes the campaign file alone."""

    schema_: Literal["sma-bayes/init/1"] = Field(alias="schema", description="name and version")
    file: str = Field(description="the campaign file that was written")
    conditions: Items[str] = Field(description="ids of the conditions that it declares")
    guesses: Items[str] = Field(description="what is guessed, one sentence each; to be checked")
    left_out: dict[str, str] = Field(description="why files were left out, by their name")


DOCUMENTS: Final = {"init": StartDocument}
