"""Without what it needs, an effect is untestable and says why."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sma_bayes.effects import EFFECTS
from sma_bayes.effects.needs import NEEDS, untestable
from sma_bayes.errors import UnknownNameError
from sma_bayes.records.history import History


def without(*names: str) -> Callable[[History], History]:
    def strip(h: History) -> History:
        return replace(
            h,
            inputs={k: v for k, v in h.inputs.items() if k not in names},
            observed={k: v for k, v in h.observed.items() if k not in names},
        )

    return strip


def changed(name: str, new: Callable[[History], np.ndarray]) -> Callable[[History], History]:
    def change(h: History) -> History:
        where = "observed" if name in h.observed else "inputs"
        return replace(h, **{where: {**getattr(h, where), name: new(h)}})

    return change


def constant(name: str, value: float) -> Callable[[History], History]:
    return changed(name, lambda h: np.full(h.n, value))


UNMET = {
    "channel": without("force", "displacement", "stiffness"),
    "outcome": without("force", "displacement", "stiffness", "temperature"),
    "share": without("share"),
    "curve": without("force", "displacement"),
    "force": without("force"),
    "displacement": without("displacement"),
    "stiffness": without("stiffness"),
    "temperature_response": without("temperature"),
    "time": without("time"),
    "current": without("current"),
    "load": without("load"),
    "frequency": without("frequency"),
    "ambient": without("ambient_temperature"),
    "ambient_varies": constant("ambient_temperature", 22.0),
    "cycles": constant("cycle", 1.0),
    "several_loads": constant("load", 1.0),
    "several_rates": changed("rate", lambda h: np.sign(h.inputs["branch"])),
    "both_branches": constant("branch", 1.0),
    "reversals": constant("branch", 1.0),
    "plateaus": changed("displacement", lambda h: h.inputs["temperature"].copy()),
}


def test_an_unknown_need_is_told_with_near_matches(measured: tuple[History, ...]) -> None:
    with pytest.raises(
        UnknownNameError, match=r"no need of an effect is called 'displacment'(.|\n)*'displacement'"
    ):
        untestable(("force", "displacment"), measured)


@pytest.mark.parametrize("need", UNMET)
def test_an_unmet_need_says_why(need: str, measured: tuple[History, ...]) -> None:
    assert NEEDS[need](measured) == ""
    assert NEEDS[need]([UNMET[need](h) for h in measured]) != ""


def test_peaks_that_do_not_vary(measured: tuple[History, ...]) -> None:
    assert NEEDS["several_peaks"](measured) == ""
    first = [h.part(h.inputs["cycle"] == 1.0) for h in measured]
    assert "not varied" in NEEDS["several_peaks"](first)


def test_a_cell_has_no_time_to_warm(measured: tuple[History, ...]) -> None:
    bare = [without("ambient_temperature")(h) for h in measured]
    quick = [changed("time", lambda h: 0.1 * h.inputs["time"])(h) for h in bare]
    assert NEEDS["warming_cell"](bare) == ""
    assert "short" in NEEDS["warming_cell"](quick)


def test_cut_tops_and_lattices(measured, suited) -> None:
    assert NEEDS["flat_tops"](measured) != ""
    assert NEEDS["flat_tops"](suited["saturation"]) == ""
    rng = np.random.default_rng(0)

    def noisy(histories, sd: float) -> list[History]:
        return [
            replace(h, observed={**h.observed, "force": h.observed["force"] + sd * rng.standard_normal(h.n)})
            for h in histories
        ]

    span = float(np.ptp(measured[0].observed["force"]))
    loud = noisy(measured, 0.01 * span)
    top = [np.quantile(h.observed["force"], 0.75) for h in loud]
    cut = [
        replace(h, observed={**h.observed, "force": np.minimum(h.observed["force"], min(top))}) for h in loud
    ]
    assert NEEDS["flat_tops"](loud) != ""
    assert NEEDS["flat_tops"](noisy(cut, 0.001 * span)) == ""
    assert NEEDS["lattice"](measured) != ""
    assert NEEDS["lattice"](suited["quantisation"]) == ""


@pytest.mark.parametrize(("end", "why"), [(0.9, ""), (2.0, "the greatest force is not cut off")])
def test_a_cut_is_seen_where_few_samples_of_a_steep_curve_bend_most(
    measured: tuple[History, ...], end: float, why: str
) -> None:
    rng, after = np.random.default_rng(1), 4e-4

    def steep(h: History) -> History:
        share = 1.0 / (1.0 + np.exp(-0.3 * (h.inputs["temperature"] - 65.0)))
        force = np.minimum(share + 4e-3 * rng.standard_normal(h.n), end) + after * rng.standard_normal(h.n)
        return replace(h, observed={**h.observed, "force": force})

    assert NEEDS["flat_tops"]([steep(h) for h in measured]) == why


def test_a_held_channel_is_named_once(measured: tuple[History, ...]) -> None:
    held = [replace(without("force")(h), held={"force": 1.0}) for h in measured]
    assert untestable(EFFECTS["saturation"].needs, held) == "force was kept constant by the rig"


def test_effects_without_their_needs(measured: tuple[History, ...]) -> None:
    held = [without("force", "load", "stiffness")(h) for h in measured]
    barred = {e.id for e in EFFECTS.values() if untestable(e.needs, held)}
    assert {
        "path_stress_shift",
        "fixture_compliance",
        "bias_spring",
        "sensor_drift",
        "stress_shift",
    } <= barred
    assert {"training_drift", "r_phase", "latent_heat"}.isdisjoint(barred)
