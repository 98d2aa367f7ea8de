"""Draw docs/images/report.png: the first screen of the report of `sma-bayes demo`, by a headless Chromium.

python docs/images/make_report.py
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

from sma_bayes.cli import command_line

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = "1240,1215"


def main() -> None:
    """Run the demo and keep a picture of the top of its report."""
    browser = next(found for name in BROWSERS if (found := shutil.which(name)))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command_line()(["demo", "--out", str(out), "--quiet"], standalone_mode=False)
        subprocess.run(
            [
                browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                f"--window-size={SIZE}", f"--screenshot={Path(__file__).with_name('report.png')}",
                (out / "report.html").as_uri(),
            ],
            check=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
