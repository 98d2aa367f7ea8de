"""Tables of stiffness as a header in C99, without dynamic memory, for a controller."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from sma_bayes.studies.card.schema import TabulatedQuantiles

_DECLARATIONS: Final = """\
#ifndef SMA_BAYES_STIFFNESS_H
#define SMA_BAYES_STIFFNESS_H

/* One branch of one condition: rows at even temperatures. */
typedef struct {
    const char *condition;
    const char *branch;           /* "heating" or "cooling" */
    const char *unit;             /* of the stiffness */
    const char *temperature_unit;
    float first;                  /* temperature of the first row [temperature_unit] */
    float step;                   /* from row to row [temperature_unit] */
    int points;                   /* rows, at least 2 */
    float interpolation_error;    /* largest error of linear interpolation [unit] */
    const float *q05;             /* 5 % quantile of the posterior [unit] */
    const float *median;          /* median [unit] */
    const float *q95;             /* 95 % quantile [unit] */
} sma_stiffness_table;

typedef struct {
    float q05;                    /* [unit of the table] */
    float median;
    float q95;
} sma_stiffness_value;
"""
_LOOK_UP: Final = """\
/* Stiffness at a temperature, by linear interpolation.
 * Gives 0 within the measured temperatures; -1 below and 1 above them, where the value at that end is given; 2 where
 * the temperature is not a number, and the value is left as it is. */
static inline int sma_stiffness_at(const sma_stiffness_table *table, float temperature, sma_stiffness_value *value)
{
    int status = 0;
    int row;
    float along = (temperature - table->first) / table->step;
    const float last = (float)(table->points - 1);

    if (!(along >= 0.0f) && !(along < 0.0f)) {
        return 2;
    }
    if (along < 0.0f) {
        along = 0.0f;
        status = -1;
    } else if (along > last) {
        status = along > last + 1e-3f ? 1 : 0;   /* rounding at the last row is not beyond it */
        along = last;
    }
    row = (int)along;
    if (row > table->points - 2) {
        row = table->points - 2;
    }
    along -= (float)row;
    value->q05 = table->q05[row] + along * (table->q05[row + 1] - table->q05[row]);
    value->median = table->median[row] + along * (table->median[row + 1] - table->median[row]);
    value->q95 = table->q95[row] + along * (table->q95[row + 1] - table->q95[row]);
    return status;
}

#endif /* SMA_BAYES_STIFFNESS_H */
"""


def stiffness_header(tables: Sequence[TabulatedQuantiles], campaign: str, source: str) -> str:
    """Header with all tables and the function that looks up in one.

    Parameters
    ----------
    tables : sequence of TabulatedQuantiles
        At least one.
    campaign : str
        Its name, for the comment.
    source : str
        Checksum of the fit.
    """
    worst = max(t.relative_error for t in tables)
    lines = [
        "/*",
        f" * Stiffness against temperature: {_comment(campaign)}.",
        f" * Written by sma-bayes card from the fit with the checksum {_comment(source)}.",
        " * Rows are linearly interpolated; the error of that is stated for each table and is at most",
        f" * {100.0 * worst:.3g} % of the stiffness. Quantiles are of the curve, not of single readings.",
        " */",
        _DECLARATIONS,
    ]
    entries, taken = [], set[str]()
    for t in tables:
        name = _identifier(f"{t.condition}_{t.branch}", taken)
        for quantile, row in (("q05", t.q05), ("median", t.median), ("q95", t.q95)):
            lines.append(
                f"static const float sma_{name}_{quantile}[{t.points}] = {{ /* {_comment(t.unit)} */"
            )
            lines += _rows(row)
            lines.append("};")
        lines.append("")
        entries.append(
            f"    {{{_string(t.condition)}, {_string(t.branch)}, {_string(t.unit)}, {_string(t.temperature_unit)},\n"
            f"     {_number(t.first)}, {_number(t.step)}, {t.points}, {_number(t.interpolation_error)},\n"
            f"     sma_{name}_q05, sma_{name}_median, sma_{name}_q95}}"
        )
    lines += [
        f"#define SMA_STIFFNESS_TABLES {len(entries)}",
        "static const sma_stiffness_table sma_stiffness_tables[SMA_STIFFNESS_TABLES] = {",
        ",\n".join(entries),
        "};",
        "",
        _LOOK_UP,
    ]
    return "\n".join(lines)


def _rows(values: Sequence[float]) -> list[str]:
    cells = [_number(v) for v in values]
    return ["    " + ", ".join(cells[i : i + 6]) + "," for i in range(0, len(cells), 6)]


def _number(value: float) -> str:
    text = f"{value:.9g}"
    return f"{text}f" if re.search(r"[.e]", text) else f"{text}.0f"


def _identifier(text: str, taken: set[str]) -> str:
    base = name = re.sub(r"[^A-Za-z0-9]+", "_", text)
    count = 1
    while name in taken:
        count += 1
        name = f"{base}_{count}"
    taken.add(name)
    return name


def _string(text: str) -> str:
    """String literal; what is not ASCII as octal escapes of its UTF-8."""
    bytes_of = text.encode("utf-8")
    plain = "".join(chr(b) if 32 <= b < 127 and b not in b'"\\?' else f"\\{b:03o}" for b in bytes_of)
    return f'"{plain}"'


def _comment(text: str) -> str:
    """Text that does not end or nest a comment, in ASCII."""
    return re.sub(r"[^ -~]", "?", text).replace("*/", "* /").replace("/*", "/ *").replace("\\", "/")
