"""What stands in a cell where not every run reached the target."""

from __future__ import annotations

from benchmark_tables import cell


def run(seconds: float, ended: str, claimed: float = float("nan")) -> dict[str, str]:
    return {
        "cpu_s": str(seconds),
        "reached": str(ended == "target"),
        "ended": ended,
        "claimed_s": str(claimed),
    }


def test_a_cell_says_what_became_of_the_runs() -> None:
    done = run(2.0, "target", 2.0)
    assert cell([]) == "not measured"
    assert cell([done, run(4.0, "target", 4.0)]) == "3"
    assert cell([run(30.0, "time")]) == "> 30"
    assert cell([run(30.0, "time", 3.0)]) == "> 30 †"
    assert cell([run(41.0, "killed")]) == "> 41 ‡"
    assert cell([done, done, run(30.0, "time")]) == "> 2 (2 of 3)"
