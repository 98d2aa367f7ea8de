"""Priors as TOML: what is believed about each parameter, on which branch, on whose word.

A file may build on a set that ships (``extends = "modified_sigmoid"``) and then speak only of what is new or different.
A priors file has a table a branch (``both``, ``heating``, ``cooling``; the branch's own wins), in it a table a
parameter, and ``noise`` for the parameters of the noise. Where a parameter is given as an array of tables, the
first whose scale was observed is used::

    [[both.A1]]
    family = "lognormal"
    median = 1.0
    sigma = 1.0
    relative_to = "span(displacement)"   # numbers are multiples of this
    sign = "trend(displacement)"     # +1 or -1, from the record
    source = "weakly informative"

    [heating.B4]
    fixed = 0.0
    unit = "N"
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sma_bayes.errors import PriorError, QuantityError, near_matches, require_known
from sma_bayes.limits import MAGNITUDE
from sma_bayes.parameters.distributions import FAMILIES, Distribution
from sma_bayes.parameters.scales import RecordScales
from sma_bayes.parameters.space import Parameter, ParameterSpec
from sma_bayes.quantities import CHANNELS, convert
from sma_bayes.records.toml_table import declared_bytes, parsed_toml
from sma_bayes.records.types import Branch

SCHEMA = "sma-bayes/priors/1"
_TOP = ("schema", "extends", "model", "title", "source", "both", "heating", "cooling", "noise")
_TABLES = ("both", "heating", "cooling", "noise")
_KEYS = ("family", "unit", "relative_to", "sign", "source", "fixed")


@dataclass(frozen=True, slots=True)
class PriorEntry:
    """One belief about one parameter, as written."""

    numbers: Mapping[str, float]
    family: str
    unit: str
    relative_to: str
    sign: str | float
    source: str
    fixed: float | None
    where: str


@dataclass(frozen=True)
class PriorSet:
    """All that a priors file says.

    Attributes
    ----------
    title, source : str
    entries : mapping
        Branch (or ``noise``) to parameter to the beliefs in order of preference.
    file : str
        Where it was read.
    text : str
        The file as it is, for `sma-bayes priors` and for the fingerprint.
    extended : str
        Text of the sets that it builds on; empty where it stands alone.
    inherited : frozenset of tuple of str
        Table and parameter of each entry that comes from them.
    """

    title: str
    source: str
    model: str
    entries: Mapping[str, Mapping[str, tuple[PriorEntry, ...]]]
    file: str
    text: str
    extended: str = ""
    inherited: frozenset[tuple[str, str]] = frozenset()

    @property
    def whole_text(self) -> str:
        """The file, and as comments behind it those that it extends: tables in them may be taken over and changed."""
        if not self.extended:
            return self.text
        below = "\n".join(f"# {line}".rstrip() for line in self.extended.splitlines())
        remark = "# What it extends: a table of the same name, above, takes the place of one of these."
        return f"{self.text.rstrip()}\n\n{remark}\n{below}\n"

    def overridden_by(self, other: PriorSet) -> PriorSet:
        """The same beliefs, but those of another set wherever it speaks of a parameter."""
        entries = {
            table: {**self.entries.get(table, {}), **other.entries.get(table, {})}
            for table in {*self.entries, *other.entries}
        }
        return replace(self, title=other.title, source=other.source, entries=entries, file=other.file)

    def without(self, names: Collection[str]) -> PriorSet:
        """The same beliefs, but none about these parameters of the curve."""
        entries = {
            table: {k: v for k, v in beliefs.items() if table == "noise" or k not in names}
            for table, beliefs in self.entries.items()
        }
        return replace(self, entries=entries)

    def parameter(
        self, fact: ParameterSpec, branch: Branch, scales: RecordScales, *, noise: bool = False
    ) -> Parameter:
        """Parameter with the prior that is in force for a branch.

        Raises
        ------
        PriorError
            If there is no prior, its unit is of the wrong kind, or its numbers are wrong.
        """
        tables = ("noise",) if noise else (branch.value, "both")
        said = [self.entries.get(table, {}).get(fact.prior_key, ()) for table in tables]
        if not any(said) and fact.prior is not None:
            where = f"prior of {fact.name} where no file speaks of it"
            said = [(_entry(self.file, where, fact.prior),)]
        for beliefs in said:
            for belief in beliefs:
                try:
                    scale, shift = _scale_and_shift(belief, fact, scales)
                except KeyError:
                    continue
                except PriorError as error:
                    raise error.but(file=self.file, column=belief.where, remedy=None) from None
                return self._build(fact, belief, scales, scale, shift)
        raise PriorError(
            f"no prior for {fact.name} on the {branch.value} branch",
            file=self.file,
            column=f"{tables[0]}.{fact.prior_key}",
            expected="a family with its numbers, and a scale (relative_to) that was observed or a unit",
            remedy="add a table for it, or start again from what `sma-bayes priors` prints",
        )

    def _build(
        self, fact: ParameterSpec, belief: PriorEntry, scales: RecordScales, scale: float, shift: float
    ) -> Parameter:
        if not belief.unit and not belief.relative_to and fact.unit != "1" and belief.fixed != 0.0:
            raise PriorError(
                "neither a unit nor a scale",
                file=self.file,
                column=belief.where,
                expected=f"unit = {fact.unit!r} or another of its kind, or relative_to",
                remedy=f"say in which unit the numbers of {fact.name} are",
            )
        if belief.unit:
            try:
                zero, one = (
                    float(v) for v in convert(np.array([0.0, 1.0]), belief.unit, fact.unit, what=fact.name)
                )
            except QuantityError as error:
                raise PriorError(
                    error.found,
                    file=self.file,
                    column=belief.where,
                    expected=error.expected,
                    remedy=f"correct the unit; {fact.name} is in {fact.unit!r} here",
                ) from None
            scale, shift = scale * (one - zero), shift + zero
        given = dict(belief.numbers)
        if belief.sign:
            given["sign"] = self._sign(belief, fact, scales)
        if belief.fixed is not None:
            fixed = shift + scale * belief.fixed
            if fact.positive and not fixed > 0.0:
                raise PriorError(
                    f"{fact.name} is fixed at {fixed:g}",
                    file=self.file,
                    column=belief.where,
                    expected="more than zero",
                    remedy="give it a prior, or fix it at a value that it can have",
                )
            return Parameter(
                fact.name, fact.unit, fact.meaning, FAMILIES["normal"](fixed, 1.0), belief.source, fixed
            )
        kind = FAMILIES[belief.family]
        try:
            prior: Distribution = kind(**given).rescaled(scale, shift)
        except PriorError as error:
            raise error.but(file=self.file, column=belief.where) from None
        except TypeError:
            wanted = [f.name for f in fields(kind)]
            raise PriorError(
                f"{belief.family} was given {', '.join(sorted(given)) or 'no numbers'}",
                file=self.file,
                column=belief.where,
                expected=", ".join(wanted),
            ) from None
        within = prior.quantile(np.array([0.01, 0.25, 0.75, 0.99]))
        with np.errstate(divide="ignore", over="ignore"):
            inside = np.isfinite(prior.transform.unconstrain(within)).all()
        if not inside:
            raise PriorError(
                f"{prior!r} holds a hundredth or more at an end of its range, as floating-point numbers have it",
                file=self.file,
                column=belief.where,
                expected="draws that differ from the ends of the range",
                remedy="put less there; a beta or gamma distribution needs shapes of some 0.1 or more",
            )
        if not within[2] > within[1]:
            raise PriorError(
                f"{prior!r} is so narrow, or so far out, that its quartiles are one number",
                file=self.file,
                column=belief.where,
                expected="a width that floating-point numbers can tell from zero",
                remedy="widen it, or fix the parameter with fixed = ...",
            )
        return Parameter(fact.name, fact.unit, fact.meaning, prior, belief.source)

    def _sign(self, belief: PriorEntry, fact: ParameterSpec, scales: RecordScales) -> float:
        if isinstance(belief.sign, float):
            return belief.sign
        kind, _, rest = belief.sign.partition("(")
        channel = fact.channel if rest == "channel)" else rest.rstrip(")")
        if kind == "trend" and channel in CHANNELS and rest.endswith(")"):
            return scales.trend.get(channel, 1.0)
        raise PriorError(
            f"sign = {belief.sign!r}", file=self.file, column=belief.where, expected="1, -1 or trend(channel)"
        )

    def check_names(self, known: Iterable[str], known_noise: Iterable[str]) -> None:
        """Refuse a prior for a parameter that nothing has.

        Raises
        ------
        PriorError
            Naming the file, the table and near matches.
        """
        known, known_noise = list(known), list(known_noise)
        for table, beliefs in self.entries.items():
            names = known_noise if table == "noise" else known
            for name in beliefs:
                if name not in names and (table, name) not in self.inherited:
                    raise PriorError(
                        f"no parameter is called {name!r}",
                        file=self.file,
                        column=f"{table}.{name}",
                        expected=near_matches(name, names),
                        remedy=f"correct the name; or give priors of the model that is fitted, these are of "
                        f"{self.model or 'none that is named'!r}",
                    )


def priors_folder() -> Path:
    """Folder of the priors that ship with the package: inside it when installed, beside it in a checkout."""
    here = Path(__file__).resolve().parents[1]
    inside = here / "priors"
    return inside if inside.is_dir() else here.parent / "priors"


def shipped_priors() -> tuple[str, ...]:
    """Names of the priors that ship with the package."""
    return tuple(sorted(p.stem for p in priors_folder().glob("*.toml")))


def read_priors(name_or_path: str | Path) -> PriorSet:
    """Read a priors file, or a set that ships with the package, by name.

    Raises
    ------
    PriorError
        If the file is missing, is not TOML, or says something that can't be understood.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml" and path.name == str(name_or_path):
        if path.name not in shipped_priors():
            raise PriorError(
                f"no priors are called {str(name_or_path)!r}",
                expected="the name of a shipped set, or the path of a .toml file",
                remedy=near_matches(str(name_or_path), shipped_priors()),
            )
        path = priors_folder() / f"{path.name}.toml"
    try:
        text = declared_bytes(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise PriorError(
            f"can't be read: {reason}", file=path, expected="a priors file",
            remedy="`sma-bayes priors > priors.toml` writes one to edit",
        ) from None  # fmt: skip
    return parse_priors(text, str(path))


@lru_cache(maxsize=32)
def parse_priors(text: str, file: str) -> PriorSet:
    """Understand the text of a priors file; see `read_priors`."""
    document = parsed_toml(text.encode(), Path(file), PriorError)
    if document.get("schema") != SCHEMA:
        raise PriorError(
            f"schema = {document.get('schema')!r}", file=file, column="schema", expected=f"{SCHEMA!r}"
        )
    for key in document:
        require_known(key, _TOP, f"unknown key {key!r}", PriorError, file=file, column=key)
    entries: dict[str, dict[str, tuple[PriorEntry, ...]]] = {}
    base = _extended(document, file)
    for table in _TABLES:
        said = document.get(table, {})
        if not isinstance(said, dict):
            raise PriorError(f"{table} = {said!r}", file=file, column=table, expected="a table of parameters")
        entries[table] = {
            name: tuple(
                _entry(file, f"{table}.{name}", b)
                for b in (beliefs if isinstance(beliefs, list) else [beliefs])
            )
            for name, beliefs in said.items()
        }
    inherited: frozenset[tuple[str, str]] = frozenset()
    if base is not None:
        whole = _over(base.entries, entries)
        inherited = frozenset((t, name) for t in _TABLES for name in whole[t] if name not in entries[t])
        entries = whole
    return PriorSet(
        str(document.get("title", "")),
        str(document.get("source", "")),
        str(document.get("model", "")),
        entries,
        file,
        text,
        "" if base is None else base.whole_text,
        inherited,
    )


def _extended(document: Mapping[str, Any], file: str) -> PriorSet | None:
    """The shipped set that a file builds on; None where it stands alone."""
    if "extends" not in document:
        return None
    name = document["extends"]
    if name not in shipped_priors():
        raise PriorError(
            f"extends = {name!r}",
            file=file,
            column="extends",
            expected="the name of a shipped set",
            remedy=near_matches(str(name), shipped_priors()),
        )
    if Path(file).resolve() == (priors_folder() / f"{name}.toml").resolve():
        raise PriorError(
            f"extends = {name!r}", file=file, column="extends", expected="a set other than itself"
        )
    return read_priors(name)


def _over(
    base: Mapping[str, Mapping[str, tuple[PriorEntry, ...]]],
    own: Mapping[str, dict[str, tuple[PriorEntry, ...]]],
) -> dict[str, dict[str, tuple[PriorEntry, ...]]]:
    """Beliefs of a file over those of the set that it extends: what it says of both branches holds for each."""
    out = {}
    for table in _TABLES:
        hidden = set(own[table]) | (set(own["both"]) if table in ("heating", "cooling") else set())
        kept = {name: beliefs for name, beliefs in base[table].items() if name not in hidden}
        out[table] = {**kept, **own[table]}
    return out


def _entry(file: str, where: str, belief: Any) -> PriorEntry:
    if not isinstance(belief, Mapping):
        raise PriorError(
            f"is {belief!r}", file=file, column=where, expected="a table with family and numbers"
        )
    fixed = belief.get("fixed")
    family = belief.get("family", "")
    known: Sequence[str] = _KEYS
    if fixed is None and "family" not in belief:
        known = sorted({*_KEYS, *(f.name for kind in FAMILIES.values() for f in fields(kind))})
        _refuse_unknown(file, where, belief, known)
    if fixed is None:
        if not isinstance(family, str) or family not in FAMILIES:
            raise PriorError(
                f"family = {family!r}", file=file, column=where, expected=near_matches(str(family), FAMILIES)
            )
        known = (*_KEYS, *(f.name for f in fields(FAMILIES[family])))
    _refuse_unknown(file, where, belief, known)
    for key, value in belief.items():
        if key in ("family", "unit", "relative_to", "source"):
            if not isinstance(value, str):
                raise PriorError(f"{key} = {value!r}", file=file, column=where, expected="a text")
        elif key == "sign" and isinstance(value, str):
            continue
        elif isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise PriorError(f"{key} = {value!r}", file=file, column=where, expected="a finite number")
        elif abs(value) > MAGNITUDE.value:
            raise PriorError(
                f"{key} = {value!r}", file=file, column=where, expected=f"a number up to {MAGNITUDE.value:g}"
            )
    sign = belief.get("sign", "")
    return PriorEntry(
        numbers={k: float(v) for k, v in belief.items() if k not in _KEYS},
        family=str(family),
        unit=str(belief.get("unit", "")),
        relative_to=str(belief.get("relative_to", "")),
        sign=sign if isinstance(sign, str) else float(sign),
        source=str(belief.get("source", "")),
        fixed=None if fixed is None else float(fixed),
        where=where,
    )


def _refuse_unknown(file: str, where: str, belief: Mapping[str, Any], known: Sequence[str]) -> None:
    for key in belief:
        require_known(key, known, f"unknown key {key!r}", PriorError, file=file, column=where)


def _scale_and_shift(belief: PriorEntry, fact: ParameterSpec, scales: RecordScales) -> tuple[float, float]:
    return scales.resolve(belief.relative_to, fact.channel) if belief.relative_to else (1.0, 0.0)
