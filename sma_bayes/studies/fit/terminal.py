"""A fit on the screen: a row a record, and what not to rely on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.box import HEAVY_HEAD, SIMPLE_HEAD
from rich.table import Table

from sma_bayes.assess.adequacy import remedy
from sma_bayes.errors import first_of, many
from sma_bayes.fitting.noise_choice import LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE, gained_by_temperature_error
from sma_bayes.quantities import unit_text
from sma_bayes.records.plausibility import DOUBTS
from sma_bayes.report.choice import CAMPAIGN_REPORT_ABOVE
from sma_bayes.report.screen import ENTRIES_SHOWN, screen, show_end, what_helps
from sma_bayes.runs.fit_document import TARGET, FitSummary, OptionsSummary, RecordSummary
from sma_bayes.studies.fit.inadequate import KINDS, RECORDS_NAMED, reason_groups, records_named

COLUMNS = (
    "record", "n", "noise", "converged", "adequate", "worst R-hat", "least ESS", "r", "not identified"
)  # fmt: skip
UNBROKEN = ("record", "converged", "adequate")
ALL_COLUMNS_WIDTH, LEFT_OUT = 110, ("n", "r")
"""Width from which a screen shows all columns [characters], and what a narrower one leaves to the report."""
LAST_LEFT_OUT = ("not identified", "noise", "least ESS", "worst R-hat")
"""What is left to the report, one after the other, where names of records are long: they are never shortened."""
OTHER_COLUMN_CHARACTERS = 10
"""Room that any other column takes [characters]."""


def show_fit(summary: dict[str, Any], out: Path) -> None:
    """Tell what `summary.json` says."""
    found = FitSummary.model_validate(summary)
    console = screen()
    narrow = console.width < ALL_COLUMNS_WIDTH
    table = Table(
        title=f"{found.campaign}, seed {found.seed}",
        title_justify="left",
        box=SIMPLE_HEAD if narrow else HEAVY_HEAD,
        padding=(0, 1 if not narrow else 0),
    )
    records = _worth_a_row(found.records)
    names = _columns_beside([r.key for r in records], console.width)
    for name in names:
        words = name in ("record", "noise", "not identified", "r")
        table.add_column(
            name.replace(" ", "\n") if narrow else name,
            justify="left" if words else "right",
            overflow="fold",
            no_wrap=name in UNBROKEN,
        )
    for r in records:
        sampled = [p for p in r.parameters.values() if p.rhat is not None]
        prior_driven = [n for n, p in r.parameters.items() if p.prior_driven and not p.of_noise]
        factors = ", ".join(f"{r.quantities[c].name} {_number(factor_of(r, c))}" for c in r.correlation)
        cells = (
            r.key,
            str(r.n),
            r.noise.name,
            "yes" if r.converged else "NO",
            "yes" if r.adequate else "NO",
            f"{max((p.rhat or 0.0 for p in sampled), default=float('nan')):.4f}",
            f"{min((p.ess or 0.0 for p in sampled), default=float('nan')):.0f}",
            factors,
            ", ".join(prior_driven) or "-",
        )
        table.add_row(*(cell for name, cell in zip(COLUMNS, cells, strict=True) if name in names))
    console.print(table)
    if len(found.records) > table.row_count:
        converged = sum(r.converged for r in found.records)
        console.print(f"{len(found.records)} records, {converged} converged; above are the worst by R-hat")
    alone = [f for f in found.findings if f.kind == "one-branch"]
    doubtful = [f for f in found.findings if f.kind in DOUBTS]
    console.tell(
        *(
            f"{finding.condition}: {finding.message}"
            for finding in (*alone[:ENTRIES_SHOWN], *doubtful[:ENTRIES_SHOWN])
        )
    )
    if found.findings:
        findings, rows = (
            many(len(found.findings), "finding"),
            many(sum(f.dropped for f in found.findings), "row"),
        )
        console.print(f"{findings} about the data, {rows} kept out: see the report or `sma-bayes inspect`")
    if not found.converged:
        failed = [r for r in found.records if not r.converged]
        names = [r.key for r in failed]
        whose = "Their" if len(names) > 1 else "Its"
        console.tell(
            f"NOT CONVERGED: {first_of(names, ENTRIES_SHOWN)}. {whose} numbers must not be relied on; "
            f"{_slowest(failed)}{what_helps([r.noise.name for r in failed])}."
        )
        unseen = [
            f
            for f in found.findings
            if f.kind == "no-transformation" and f"{f.condition}-{f.branch}" in names
        ]
        console.tell(*(f"{finding.condition}: {finding.message}" for finding in unseen[:ENTRIES_SHOWN]))
    console.tell(*thermometer_sentences(found.records))
    console.tell(*adequacy_sentences(found.records, found.options))
    console.tell(*self_check_sentences(found.records))
    show_end(console, summary, out)


def _slowest(failed: Sequence[RecordSummary]) -> str:
    """The parameter that is drawn worst, and what it misses; nothing where none misses its target."""
    sampled = [
        (p.ess, -(p.sd_error or 0.0), name, r)
        for r in failed
        for name, p in r.parameters.items()
        if p.ess is not None and p.rhat is not None and p.short_of_target
    ]
    if not sampled:
        return ""
    # of those with enough effective draws the one whose standard deviation is told worst
    *_, name, r = min(sampled, key=lambda s: (min(s[0], TARGET.ess), s[1]))
    return f"worst is {name} of {r.key} ({r.parameters[name].shortfall}); "


def factor_of(r: RecordSummary, channel: str) -> float | None:
    """Correlation factor of the curve of the model, without what stands beside it."""
    alone = r.fit.get(channel)
    return r.correlation[channel]["r"].median if channel not in r.discrepancy or alone is None else alone.r


def _number(value: float | None) -> str:
    """A correlation with four decimals, or so many that two tell how far from 1 it is; a dash where there is none."""
    if value is None:
        return "-"
    near = 1.0 - value
    return f"{value:.{max(4, 1 - math.floor(math.log10(near))) if near > 0.0 else 4}f}"


def _columns_beside(keys: Sequence[str], width: int) -> list[str]:
    """Columns that have room beside the names of the records."""
    if width >= ALL_COLUMNS_WIDTH:
        return list(COLUMNS)
    names = [name for name in COLUMNS if name not in LEFT_OUT]
    room = width - max(map(len, keys), default=0)
    for name in LAST_LEFT_OUT:
        if OTHER_COLUMN_CHARACTERS * (len(names) - 1) > room:
            names.remove(name)
    return names


def adequacy_sentences(records: Sequence[RecordSummary], options: OptionsSummary) -> list[str]:
    """What to say where fits are not adequate: one sentence for each kind of first reason, empty where all are.

    Parameters
    ----------
    records : sequence of RecordSummary
    options : OptionsSummary
        What was asked for; what was tried already is not advised.
    """
    return [
        f"{KINDS[group.kind].subject.format(records=group.names)}: {group.quoted}; "
        f"{remedy(group.kind, options.model, options.noise)}."
        for group in reason_groups(records, len(records))
    ]


def thermometer_sentences(records: Sequence[RecordSummary]) -> list[str]:
    """What to say where the scatter follows the slope of the curve, as an error of the thermometer makes it."""
    seen = [
        r
        for r in records
        if r.noise.name.endswith("+temperature_error")
        and gained_by_temperature_error(r.noise.name, r.noise.ln_evidence)
        >= LEAST_LN_EVIDENCE_GAIN_OF_VARIANCE
    ]
    if not seen:
        return []
    estimated = [r.parameters["temperature_sd"] for r in seen]
    sizes = [p.median or 0.0 for p in estimated]
    unit = unit_text(estimated[0].unit)
    size = f"{min(sizes):.2g}" if len(sizes) == 1 else f"{min(sizes):.2g} to {max(sizes):.2g}"
    return [
        f"The scatter of {records_named(seen, len(records))} follows the slope of the curve, as an error "
        f"of the thermometer of {size} {unit} from reading to reading makes it; intervals count it. Where its size is "
        "known, declare it: `sd = ...` with the column of temperature."
    ]


def self_check_sentences(records: Sequence[RecordSummary]) -> Iterator[str]:
    """What the self-check found, one sentence for all that passed and one for each record that did not."""
    found = [(r.key, r.self_check) for r in records if r.self_check is not None]
    if not found:
        return
    good = [c for _, c in found if c.passed]
    rate = f"false alarm in {100 * found[0][1].false_alarm_rate:g} % of records at most"
    if good:
        held = [one for c in good for q in c.quantities for one in q.coverage if one.level == 0.9]
        least, most = (100 * f(one.share for one in held) for f in (min, max))
        fewest, refits = (f(c.replicates for c in good) for f in (min, max))
        counted = f"{refits}" if fewest == refits else f"{fewest} to {refits}"
        yield (
            f"Self-check: {len(good)} of {many(len(found), 'record')} passed, {counted} refits of simulated "
            f"measurements each; 90 % intervals held {least:.3g} to {most:.3g} % of the truths ({rate})."
        )
    for key, c in found:
        if not c.passed:
            wrong = [q.name for q in c.quantities if not q.uniform]
            why = (
                f"ranks of {first_of(wrong, RECORDS_NAMED)} are not uniform"
                if wrong
                else f"{c.failed} of {c.replicates} refits missed their target"
            )
            yield f"Self-check FAILED for {key}: {why} ({rate}); do not rely on its intervals."


def _worth_a_row(records: Sequence[RecordSummary]) -> Sequence[RecordSummary]:
    """All records, or of very many those that converged worst."""

    def worst_rhat(r: RecordSummary) -> float:
        return max((p.rhat or 0.0 for p in r.parameters.values()), default=0.0)

    if len(records) <= CAMPAIGN_REPORT_ABOVE:
        return records
    return sorted(records, key=lambda r: (r.converged, -worst_rhat(r)))[:ENTRIES_SHOWN]
