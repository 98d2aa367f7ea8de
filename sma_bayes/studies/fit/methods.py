"""A paragraph of methods for a paper, and the references that it cites, from what was done and nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

from sma_bayes.errors import many
from sma_bayes.report.content import INTERVAL, Content, RecordContent
from sma_bayes.report.notation import compact, count_text, unit_label
from sma_bayes.response import DEFAULT_MODEL
from sma_bayes.runs.fit_document import TARGET
from sma_bayes.studies.fit.inadequate import KINDS

REFERENCES: Final = {
    "sul2019": """@article{sul2019,
  author = {Sul, Bhagoji B. and Dhanalakshmi, K.},
  title = {Modified sigmoid based model and experimental analysis of shape memory alloy spring as variable
    stiffness actuator},
  journal = {Smart Structures and Systems},
  volume = {24}, number = {3}, pages = {361--377}, year = {2019},
  doi = {10.12989/sss.2019.24.3.361}
}""",
    "foremanmackey2013": """@article{foremanmackey2013,
  author = {Foreman-Mackey, Daniel and Hogg, David W. and Lang, Dustin and Goodman, Jonathan},
  title = {emcee: The {MCMC} Hammer},
  journal = {Publications of the Astronomical Society of the Pacific},
  volume = {125}, number = {925}, pages = {306--312}, year = {2013},
  doi = {10.1086/670067}
}""",
    "vehtari2021": """@article{vehtari2021,
  author = {Vehtari, Aki and Gelman, Andrew and Simpson, Daniel and Carpenter, Bob and B{\\"u}rkner, Paul-Christian},
  title = {Rank-normalization, folding, and localization: An improved {$\\widehat{R}$} for assessing
    convergence of {MCMC}},
  journal = {Bayesian Analysis},
  volume = {16}, number = {2}, pages = {667--718}, year = {2021},
  doi = {10.1214/20-BA1221}
}""",
    "terbraak2006": """@article{terbraak2006,
  author = {ter Braak, Cajo J. F.},
  title = {A {Markov} Chain {Monte} {Carlo} version of the genetic algorithm Differential Evolution: easy {Bayesian}
    computing for real parameter spaces},
  journal = {Statistics and Computing},
  volume = {16}, number = {3}, pages = {239--249}, year = {2006},
  doi = {10.1007/s11222-006-8769-1}
}""",
    "astme3097": """@techreport{astme3097,
  author = {{ASTM International}},
  title = {{ASTM} {E3097}: Standard Test Method for Mechanical Uniaxial Constant Force Thermal Cycling of Shape
    Memory Alloys},
  institution = {ASTM International}, number = {E3097-23}, year = {2023}
}""",
}  # fmt: skip
"""BibTeX entries by key."""

FITTED: Final = "independence moves with proposals fitted to the posterior, not its stretch moves"

MOVES: Final = {
    "independence": FITTED,
    "independence after an audit": FITTED,
    "independence after differential evolution": "independence moves with proposals fitted to draws of differential "
    "evolution [@terbraak2006], not its stretch moves",
    "independence and differential evolution": "independence moves and differential evolution [@terbraak2006], not its "
    "stretch moves",
    "differential evolution": "differential evolution [@terbraak2006], not its stretch moves",
    "stretch": "stretch moves",
}
"""What made the draws, by `SamplerSummary.method`."""


def methods_text(content: Content) -> str:
    """What was done, as a paragraph in Markdown that cites `REFERENCES` as ``[@key]``."""
    return " ".join(_sentences(content)) + "\n"


def bibliography(content: Content) -> str:
    """BibTeX entries of what `methods_text` cites, and of this package."""
    text = methods_text(content)
    version = content.document.versions.get("sma-bayes", "")
    own = f"""@misc{{smabayes,
  author = {{{{The sma\\_bayes developers}}}},
  title = {{sma\\_bayes: Bayesian stiffness of shape memory alloy springs}},
  note = {{version {version}}}
}}"""
    cited = [entry for key, entry in REFERENCES.items() if f"@{key}" in text]
    return "\n\n".join([*cited, own]) + "\n"


def _adequacy(content: Content) -> str:
    """How many records curve and noise describe, and what the others fail."""
    records = content.records
    told = f"Curve and noise describe {len(records) - len(content.inadequate)} of {len(records)} records"
    counts = (
        (sum(any(w.kind == kind for w in r.document.why) for r in records), words.counted)
        for kind, words in KINDS.items()
    )
    reasons = "; ".join(f"in {count} {text}" for count, text in counts if count)
    return f"{told}: {reasons}." if reasons else f"{told}."


def _sentences(content: Content) -> Iterator[str]:
    records, p = content.records, content.document
    observed = dict.fromkeys(c.name for r in records for c in r.channels if c.observed)
    samples = count_text(sum(r.document.n for r in records))
    yield (
        f"{_joined(list(observed)).capitalize()} against temperature of {many(len(content.conditions), 'condition')} "
        f"({many(len(records), 'record')} of one branch each, {samples} samples{_averaged(records)}) were described by "
        f"{_models(records)}."
    )
    yield (
        "Parameters of each record were inferred by Bayesian inference"
        if p.options.pool == "none"
        else "Parameters, common to all conditions of a branch, were inferred by Bayesian inference"
    ) + f" under the priors “{p.options.priors}” and {_noises(records)}."
    if any(r.temperature_sd for r in records):
        errors = dict.fromkeys(
            f"{compact(r.temperature_sd)} {unit_label(r.temperature_unit)}"
            for r in records
            if r.temperature_sd
        )
        yield f"The error of a single reading of temperature (sd {_joined(list(errors))}) is part of the likelihood."
    if calibrations := list(dict.fromkeys(text for r in records for text in r.calibration)):
        yield f"Errors of the calibration were added to the draws of the posterior ({'; '.join(calibrations)})."
    if any(r.document.discrepancy for r in records):
        count = sum(bool(r.document.discrepancy) for r in records)
        yield (
            f"In {many(count, 'record')} a smooth discrepancy, kept off the tangents of the curve, "
            "stands beside the curve, where the evidence was for it."
        )
    yield (
        f"Posteriors were drawn with emcee {p.versions.get('emcee', '')} [@foremanmackey2013]{_moves(records)}; "
        f"{len(content.converged)} of {len(records)} records converged, with rank-normalised R-hat of at most "
        f"{TARGET.rhat}, bulk and tail effective sample sizes of at least {TARGET.ess:.0f}, and Monte Carlo standard "
        f"errors of at most {TARGET.quantile_error} sd of the 2.5 and 97.5 % quantiles and "
        f"{100.0 * TARGET.sd_error:.1f} % of the standard deviation, for every parameter as sampled [@vehtari2021]."
    )
    yield _adequacy(content)
    stiffness = next((c.name for c in content.channels if c.channel == "stiffness"), None)
    if stiffness is not None and not any(c.observed for c in content.channels if c.channel == "stiffness"):
        yield (
            f"The {stiffness} is the slope of force over displacement along the actuation path, from their joint "
            "posterior."
        )
    if any(r.document.transformation for r in records):
        yield (
            "Transformation temperatures were read off each posterior curve by the tangent rule of ASTM E3097 "
            "[@astme3097]."
        )
    yield (
        f"Values are posterior medians with the {INTERVAL}. The analysis was made with sma_bayes "
        f"{p.versions.get('sma-bayes', '')} [@smabayes], seed {p.seed}; SHA-256 of the data: {p.data_sha256}."
    )


def _averaged(records: Sequence[RecordContent]) -> str:
    """How many rows of a file are one sample, where that is more than one."""
    most = max(r.document.rows_averaged for r in records)
    return f", means of up to {most} rows" if most > 1 else ""


def _moves(records: Sequence[RecordContent]) -> str:
    """What made the draws, in how many records where not in all."""
    counts = Counter(MOVES[m] for r in records if (m := r.document.sampler.method))
    told = [
        f"by {words}" if len(counts) == 1 else f"in {count} by {words}"
        for words, count in counts.most_common()
    ]
    return f" {', '.join(told)}" if told else ""


def _models(records: Sequence[RecordContent]) -> str:
    names = list(dict.fromkeys(r.model for r in records))
    published = " of Sul and Dhanalakshmi [@sul2019]"
    told = [
        f"the {n.replace('_', ' ')}{published if n == DEFAULT_MODEL else ' response model'}" for n in names
    ]
    return _joined(told)


def _noises(records: Sequence[RecordContent]) -> str:
    titles = list(dict.fromkeys((r.document.noise.title or r.document.noise.name) for r in records))
    chosen = {r.document.noise.chosen_by for r in records}
    how = f", chosen by {chosen.pop()}" if len(chosen) == 1 and chosen != {""} else ""
    return f"{'a noise model' if len(titles) == 1 else 'noise models'} ({'; '.join(titles)}{how})"


def _joined(words: Sequence[str]) -> str:
    return " and ".join((", ".join(words[:-1]), words[-1])) if len(words) > 1 else "".join(words)
