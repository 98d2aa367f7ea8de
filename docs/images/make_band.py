"""Draw docs/images/band.png: one condition of the twin campaign, stiffness derived from force and displacement.

python docs/images/make_band.py
"""

import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import sma_bayes

CONDITION = "100g-10mHz"


def main() -> None:
    """Fit both branches and keep the figure of the loop."""
    twin = sma_bayes.twin_campaign(channels=("force", "displacement"))
    chosen = tuple(r for r in twin.records if r.condition.id == CONDITION)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        sma_bayes.fit_campaign(replace(twin, records=chosen), out)
        shutil.copyfile(out / "figures" / f"loop-{CONDITION}.png", Path(__file__).with_name("band.png"))


if __name__ == "__main__":
    main()
