"""A named table of interchangeable things: response models, noise models, data formats.

Each folder that holds one idea a file lists them in a `Catalogue`; packages outside join by entry point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from sma_bayes.errors import SmaBayesError, UnknownNameError, near_matches

T = TypeVar("T")


class Catalogue(Mapping[str, T], Generic[T]):
    """Read-only mapping from name to entry whose look-up failure lists near matches.

    Parameters
    ----------
    kind : str
        What the entries are, for messages: ``"noise model"``.
    entries : mapping
        The entries that ship with the package.
    entry_point_group : str, optional
        Group under which other distributions may add entries; read at the first look-up. A name that is
        already taken is an error, and so is an entry that can't be imported.
    """

    def __init__(self, kind: str, entries: Mapping[str, T], entry_point_group: str | None = None) -> None:
        self.kind = kind
        self._entries = dict(entries)
        self._group = entry_point_group

    def _load(self) -> dict[str, T]:
        if self._group is None:
            return self._entries
        entries = dict(self._entries)
        for point in entry_points(group=self._group):
            if point.name in entries:
                raise UnknownNameError(
                    f"two packages provide the {self.kind} {point.name!r}",
                    expected="one provider for each name",
                    remedy=f"uninstall one of them; the second is {point.value}",
                )
            entries[point.name] = self._loaded(point)
        self._entries, self._group = entries, None
        return entries

    def _loaded(self, point: EntryPoint) -> T:
        try:
            entry: T = point.load()
        except Exception as error:
            raise SmaBayesError(
                f"the {self.kind} {point.name!r} of another package can't be loaded: {type(error).__name__}: {error}",
                expected=f"{point.value}, which that package names, to be there and to be imported without an error",
                remedy="repair that package, or uninstall it",
            ) from error
        return entry

    def __getitem__(self, name: str) -> T:
        entries = self._load()
        try:
            return entries[name]
        except KeyError:
            raise UnknownNameError(
                f"no {self.kind} is called {name!r}", expected=near_matches(name, entries)
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self._load()

    def __iter__(self) -> Iterator[str]:
        return iter(self._load())

    def __len__(self) -> int:
        return len(self._load())
