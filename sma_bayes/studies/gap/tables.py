"""Tables of a gap study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

from sma_bayes.report.content import INTERVAL, Number
from sma_bayes.report.notation import unit_label
from sma_bayes.report.tables import UNIT_OF_ROW, Column, Table, table_of, words
from sma_bayes.runs.schema import IntervalDocument
from sma_bayes.studies.gap.outcome import HEATING
from sma_bayes.studies.gap.outputs import StoredStudy
from sma_bayes.studies.gap.schema import HeatingFindings
from sma_bayes.studies.gap.words import channel_text, covariate_text

ADVICE: Final[Mapping[str, str]] = {
    "time": "record the time of every sample",
    "current": "record the heating current of every sample",
    "temperature_response": "record heating current and time of every sample",
    "load": "declare the load of each condition",
    "several_runs": "repeat the run: three or more, and 24 at most, and study them pooled",
    "several_cycles": "measure three cycles or more, and 24 at most in all, without a break",
    "several_loads": "measure at two loads or more and study them pooled",
    "several_rates": "record time, sweep at two rates or more that differ clearly and study them pooled",
    "several_peaks": "turn round at different peak temperatures",
    "frequency": "declare the frequency of the drive",
    "ambient": "record the ambient temperature",
    "ambient_varies": "record the ambient temperature, over a day or while the room warms",
    "cycles": "measure three cycles or more without a break",
    "both_branches": "measure heating and cooling",
    "force": "measure force, on a rig that does not hold it constant",
    "displacement": "measure displacement, on a rig that does not hold it constant",
    "stiffness": "measure stiffness, by a small pull at each temperature",
    "channel": "measure force, displacement or stiffness",
    "outcome": "measure force, displacement or stiffness",
    "share": "measure force or displacement",
    "resistance_unknown": "nothing: the resistance was measured, and is used",
    "curve": "measure force or displacement",
    "reversals": "keep the record going through two reversals or more without a break",
    "warming_cell": "record time or the ambient temperature over five minutes or more, so that the load cell can warm",
    "plateaus": "sweep from well below to well above the transformation, so that both plateaus show",
}
"""What to record or vary, for each need of an effect."""
UNMEASURABLE_NEEDS: Final = frozenset({"lattice", "flat_tops"})
"""Needs that ask for a mark in the readings: where it is missing there is nothing to test, however one measures."""


def gap_tables(study: StoredStudy) -> dict[str, Table]:
    """All tables of a study, by name."""
    made = (
        disagreement_table(study),
        effect_table(study),
        candidate_table(study),
        untestable_table(study),
        closed_table(study),
        noise_table(study),
    )
    tables = {table.name: table for table in made}
    balance = study.found.heating
    if study.heating is None or balance is None:
        return tables
    heating = {name: replace(t, name=f"{HEATING}-{name}") for name, t in gap_tables(study.heating).items()}
    return tables | {t.name: t for t in (*heating.values(), heat_balance_table(balance))}


def closed_table(study: StoredStudy) -> Table:
    """How far residuals of each channel came down on held-out measurements."""
    return Table(
        "gap",
        "Held-out residuals beside the noise",
        "Root mean square of what was held out, before and after effects were added: as innovations of the noise, in "
        "its standard deviations, and as they are, beside what noise alone would leave. Share of the gap "
        "closed: of the way from before to noise alone.",
        (
            Column("channel", "channel"),
            Column("before [sd]", "before_sigma", "1"),
            Column("after [sd]", "after_sigma", "1"),
            Column("share of the gap closed", "way_to_noise", "1"),
            Column("unit", "unit"),
            Column("before", "before", UNIT_OF_ROW),
            Column("after", "after", UNIT_OF_ROW),
            Column("noise", "noise", UNIT_OF_ROW),
        ),
        tuple(
            (
                channel_text(study.part.channels, channel),
                *(Number(v, "1", 0.01) for v in (c.before_sigma, c.after_sigma, c.way_to_noise)),
                unit_label(c.unit) or "1",
                *(Number(v, c.unit, c.noise / 10.0) for v in (c.before, c.after, c.noise)),
            )
            for channel, c in study.part.gap.channels.items()
        ),
    )


def heat_balance_table(heating: HeatingFindings) -> Table:
    """Gain, loss, time constant, ambient temperature and switching."""
    return Table(
        f"{HEATING}-parameters",
        "Parameters of the heat balance",
        f"5 % and 95 % bound the {INTERVAL}. Switching is the share of a step of the record that passes before the "
        "current changes: 1 where each reading holds until the next, 0 where it holds since the last; scatter, its "
        "standard deviation from switching to switching, in steps.",
        (
            *words("parameter", "meaning", "unit"),
            Column("5 %", "q05", UNIT_OF_ROW),
            Column("median", "median", UNIT_OF_ROW),
            Column("95 %", "q95", UNIT_OF_ROW),
            Column("scatter", "scatter", "1"),
        ),
        tuple(
            (
                name, p.meaning, unit_label(p.unit) or "1",
                *_quantiles(p, p.unit),
                Number(p.scatter, "1", 0.1),
            )
            for name, p in heating.parameters.items()
        ),
    )  # fmt: skip


def disagreement_table(study: StoredStudy) -> Table:
    """Stretches over which residuals lie to one side, numbered as in the figure."""
    found = study.part.disagreement or study.part.within_chance
    chance = bool(study.part.within_chance)
    return Table(
        "disagreement",
        "Stretches of the greatest mean residual, by chance" if chance else "Where model and measurement disagree",
        "Size: mean residual over the stretch, in standard errors, after the parameters have adapted as "
        "best they can. It tells the places apart; whether there is more than chance, the global p-value alone tells. "
        "Measured: on average above or below the model.",
        (
            Column("rank", "number", "1"),
            *words("condition", "branch", "channel", "covariate"),
            Column("from", "from", UNIT_OF_ROW),
            Column("to", "to", UNIT_OF_ROW),
            Column("unit", "unit"),
            Column("size [standard errors]", "size_sigma", "1"),
            Column("measured", "side"),
        ),
        tuple(
            (
                i, d.condition, d.branch, channel_text(study.part.channels, d.channel),
                covariate_text(study.part.channels, d.covariate),
                *(round(v) if d.covariate in COUNTED_COVARIATES else Number(v, d.unit) for v in (d.from_, d.to)),
                unit_label(d.unit) or "1",
                Number(abs(d.size_sigma), "1", 0.5), "above" if d.mean_residual > 0.0 else "below",
            )
            for i, d in enumerate(found, 1)
        ),
    )  # fmt: skip


COUNTED_COVARIATES: Final = ("order", "cycle")
"""Covariates that are whole numbers."""


def _quantiles(found: IntervalDocument, unit: str) -> Iterator[Number]:
    """The three, each with the digits that the standard deviation bears."""
    low, median, high = found.quantiles
    return (Number(q, unit, (high - low) / 3.29) for q in (low, median, high))


def effect_table(study: StoredStudy) -> Table:
    """Parameters of the effects that were added."""
    names = {e.id for e in study.part.effects}
    return table_of(
        "effects",
        "Parameters of the added effects",
        f"5 % and 95 % bound the {INTERVAL}. “Outside the prior”: the interval of the posterior does not meet the 90 % "
        "range of the prior, which is what the literature gives.",
        [(e, name, p, [*_quantiles(p, p.unit)]) for e in study.effects for name, p in e.parameters.items()],
        (Column("effect", "effect"), lambda e, name, p, q: e.id),
        (
            Column("status", "status", brief=False),
            lambda e, name, p, q: "named" if e.id in names else "partial",
        ),
        (Column("class", "class", brief=False), lambda e, name, p, q: ", ".join(e.class_)),
        (
            Column("probability", "probability", "1", brief=False),
            lambda e, name, p, q: Number(e.probability, "1", 0.01),
        ),
        (
            Column("ln Bayes factor", "ln_bayes_factor", "1", brief=False),
            lambda e, name, p, q: Number(e.ln_bayes_factor, "1", 1.0),
        ),
        (Column("parameter", "parameter"), lambda e, name, p, q: name),
        (Column("meaning", "meaning"), lambda e, name, p, q: p.meaning),
        (Column("unit", "unit"), lambda e, name, p, q: unit_label(p.unit) or "1"),
        (Column("5 %", "q05", UNIT_OF_ROW), lambda e, name, p, q: q[0]),
        (Column("median", "median", UNIT_OF_ROW), lambda e, name, p, q: q[1]),
        (Column("95 %", "q95", UNIT_OF_ROW), lambda e, name, p, q: q[2]),
        (
            Column("prior 5 %", "prior_q05", UNIT_OF_ROW),
            lambda e, name, p, q: Number(p.prior_range[0], p.unit),
        ),
        (
            Column("prior 95 %", "prior_q95", UNIT_OF_ROW),
            lambda e, name, p, q: Number(p.prior_range[1], p.unit),
        ),
        (Column("outside the prior", "outside_prior"), lambda e, name, p, q: p.outside_prior),
        (Column("R-hat", "rhat", "1"), lambda e, name, p, q: Number(p.rhat, "1", 0.01)),
        (Column("least ESS", "ess", "1"), lambda e, name, p, q: Number(p.least_ess, "1", 10.0)),
    )


def candidate_table(study: StoredStudy) -> Table:
    """Every effect of the catalogue and what became of it."""
    return Table(
        "candidates",
        "Candidates",
        "As judged in the first round; what was added later, as judged then, over what had been added before. "
        "Bayes factors of candidates that were not refitted in full are those of the screening. Score: gain in log "
        "predictive density of held-out measurements, with its standard error.",
        (
            Column("effect", "effect"),
            Column("title", "title", brief=False),
            Column("round", "round", "1"),
            Column("ln Bayes factor", "ln_bayes_factor", "1"),
            Column("refitted", "refitted", brief=False),
            Column("held-out score", "delta_elpd_held_out", "1"),
            Column("its error", "delta_elpd_se", "1"),
            Column("status", "status"),
            Column("why", "finding"),
        ),
        tuple(
            (
                c.id, c.title, None if c.status == "untestable" else c.round,
                Number(c.ln_bayes_factor, "1", 1.0), c.refitted,
                Number(c.delta_elpd_held_out, "1", c.delta_elpd_se),
                Number(c.delta_elpd_se, "1", c.delta_elpd_se), c.status, c.why,
            )
            for c in study.part.candidates
        ),
    )  # fmt: skip


def untestable_table(study: StoredStudy) -> Table:
    """What could not be tested, and what recording would make it testable."""
    rows = []
    for c in study.part.candidates:
        if c.status == "untestable":
            there = UNMEASURABLE_NEEDS & set(c.unmet)
            todo = [ADVICE.get(n, n.replace("_", " ")) for n in c.unmet if n not in UNMEASURABLE_NEEDS]
            advice = "nothing: these readings show no sign of it" if there else "; ".join(dict.fromkeys(todo))
            rows.append((c.id, c.title, c.why, advice))
    return Table(
        "untestable",
        "What could not be tested",
        "These effects may be there all the same.",
        (
            Column("effect", "effect"),
            Column("title", "title", brief=False),
            Column("why not", "finding"),
            Column("what would make it testable", "remedy"),
        ),
        tuple(rows),
    )


def noise_table(study: StoredStudy) -> Table:
    """Noise of each condition and channel."""
    return table_of(
        "noise",
        "Noise",
        "AR(1): standard deviation, and correlation of neighbouring samples.",
        [(n, study.part.channels[n.channel].unit) for n in study.part.noise],
        (Column("condition", "condition"), lambda n, unit: n.condition),
        (Column("channel", "channel"), lambda n, unit: channel_text(study.part.channels, n.channel)),
        (Column("unit", "unit"), lambda n, unit: unit_label(unit) or "1"),
        (Column("sd", "sd", UNIT_OF_ROW), lambda n, unit: Number(n.sd, unit, n.sd / 10.0)),
        (Column("correlation", "lag1", "1"), lambda n, unit: Number(n.lag1, "1", 0.1)),
    )
