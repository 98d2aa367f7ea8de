"""A named table of interchangeable things: response models, noise models, data formats.

Each folder that holds one idea a file lists them in a `Catalogue`; packages outside join by entry point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from sma_bayes.errors import SmaBayesError, UnknownNameError, require_known

T = TypeVar("T")


def not_a(kind: type, attribute: str = "") -> Callable[[str, object], str]:
    """What is wrong with an entry that is to be of a class, and to bear the name that it is listed under.

    Parameters
    ----------
    kind : type
        ``type`` where entries are classes; ``object`` takes any instance.
    attribute : str, optional
        Attribute that is to be the name.
    """

    def fault(name: str, entry: object) -> str:
        if isinstance(entry, type) and kind is not type:
            return f"is a class, not an instance: append () where it is named, {entry.__name__}()"
        if not isinstance(entry, kind):
            return f"is a {type(entry).__name__}, not a {'class' if kind is type else kind.__name__}"
        if attribute and getattr(entry, attribute, None) != name:
            return f"has the {attribute} {getattr(entry, attribute, None)!r}, not the name of its entry point, {name!r}"
        return ""

    return fault


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
    fault : callable, optional
        From the name and the entry of another distribution to why it can't be taken, empty where it can.
    """

    def __init__(
        self,
        kind: str,
        entries: Mapping[str, T],
        entry_point_group: str | None = None,
        fault: Callable[[str, object], str] = lambda name, entry: "",
    ) -> None:
        self.kind = kind
        self._fault = fault
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
        if why := self._fault(point.name, entry):
            raise SmaBayesError(
                f"the {self.kind} {point.name!r} of another package can't be used: {point.value} {why}",
                remedy="repair that package, or uninstall it",
            )
        return entry

    def __getitem__(self, name: str) -> T:
        entries = self._load()
        require_known(name, entries, f"no {self.kind} is called {name!r}")
        return entries[name]

    def __contains__(self, name: object) -> bool:
        return name in self._load()

    def __iter__(self) -> Iterator[str]:
        return iter(self._load())

    def __len__(self) -> int:
        return len(self._load())
