"""Average correlation factors of the models, in sample and held out."""

from __future__ import annotations

from sma_bayes.report.content import PAPER_CORRELATION
from sma_bayes.report.figures.averages import Mark, average_columns, correlation_axis, tell_apart
from sma_bayes.report.figures.sheet import Drawing, dot_handle, empty_sheet, label_width, name_rows, panels
from sma_bayes.studies.compare.figures.models import drawn_order, look
from sma_bayes.studies.compare.schema import StoredComparison
from sma_bayes.studies.compare.tables import model_averages
from sma_bayes.studies.compare.words import short


def model_average_figure(stored: StoredComparison) -> Drawing:
    """Average correlation factor of each model over all records of a channel, in sample and held out."""
    found = [(name, a) for name, a in model_averages(stored) if a.rule == "plain"]
    channels = list(dict.fromkeys((a.document.quantity, a.document.unit) for _, a in found))
    models = drawn_order(dict.fromkeys(name for name, _ in found))
    left = label_width(short(n) for n in models)
    figure = empty_sheet(left + max(2.7 * len(channels), 4.5) + 0.15, 1.15 + 0.26 * len(models))
    axes = panels(figure, 1, len(channels), left=left, bottom=0.75, top=0.35, gap_x=0.25)[0]
    for ax, channel in zip(axes, channels, strict=True):
        marks = [
            Mark(
                models.index(name) + (-0.16 if a.data == "in sample" else 0.16),
                a.factors["r"],
                look(name)[0],
                a.data == "in sample",
            )
            for name, a in found
            if (a.document.quantity, a.document.unit) == channel
        ]
        correlation_axis(ax, marks)
        name_rows(ax, [short(n) for n in models], labelled=ax is axes[0])
        ax.set_title(f"average r of {channel[0]}")
        tell_apart(ax, channel, channels)
    figure.legend(
        handles=[dot_handle("#555555", "in sample", hollow=True), dot_handle("#555555", "held out")],
        loc="lower center", ncols=2, borderaxespad=0.1,
    )  # fmt: skip
    columns = average_columns([a for _, a in found])
    return Drawing(
        stem="correlation-average",
        caption=(
            "Plain mean of r over the records of a channel: posterior median and equal-tailed 90 % credible interval, "
            "of the data to which the models were fitted and of what was held out. The axis is logarithmic in 1 − r; "
            f"dashed: the {PAPER_CORRELATION:g} that the paper states of its model."
        ),
        alt="average correlation factors of the models, in sample and held out, beside 0.95",
        figure=figure,
        data={"model": [name for name, _ in found], **columns},
    )
