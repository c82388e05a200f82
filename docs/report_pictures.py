"""Draws the pictures of reports in docs/figures, with Chromium.

.venv-browser/bin/python docs/report_pictures.py [--scenarios FOLDER]     # after `make .venv-browser/.chromium`

The picture of many agents needs the public file USA_US101-23_1_T-1.xml below FOLDER; without it, it is left alone.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from playwright.sync_api import sync_playwright

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def interdrive(*words: object) -> None:
    """Runs a command of interdrive."""
    subprocess.run([ROOT / ".venv" / "bin" / "interdrive", *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def picture(browser: Browser, report: Path, name: str, *, keys: str = "", agent: int = -1, height: int = 768) -> None:
    """A picture of a page on a laptop: a chosen agent, then keys one after the other."""
    page = browser.new_page(viewport={"width": 1366, "height": height})
    page.goto(report.as_uri())
    page.wait_for_timeout(1500)
    if agent >= 0:
        page.locator(f'tr[data-agent="{agent}"]').click()
    for key in keys.split():
        page.keyboard.press(key)
    page.wait_for_timeout(500)
    page.screenshot(path=FIGURES / name)
    page.close()


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    scenarios = os.environ.get("INTERDRIVE_SCENARIOS", ROOT.parent / "shared" / "scenarios")
    parser.add_argument("--scenarios", type=Path, default=Path(scenarios))
    file = parser.parse_args().scenarios / "highway" / "USA_US101-23_1_T-1.xml"
    chromium = next(filter(None, map(shutil.which, NAMES)))
    with tempfile.TemporaryDirectory() as made, sync_playwright() as playwright:
        folder = Path(made)
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        interdrive("run", "t_junction", "--agents", "all", "--out", folder / "run", "--report")
        picture(browser, folder / "run" / "report.html", "report_run.png", agent=1003, keys="Shift+ArrowRight " * 3)
        options = ("--kind", "velocity", "--out", FIGURES / "plot_velocity.png")
        interdrive("plot", folder / "run", *options)
        names = ("t_junction", "lane_merge", "highway", "intersection")
        planners = ("--planner", "rollout,idm,idm_mobil")
        interdrive("batch", *names, *planners, "--keep", "all", "--out", folder / "four", "--quiet")
        interdrive("report", folder / "four")
        picture(browser, folder / "four" / "report.html", "report_batch.png", height=1020)
        if file.exists():
            interdrive("run", file, "--agents", "all", "--out", folder / "many", "--report")
            keys = "t v " + "Shift+ArrowRight " * 4
            picture(browser, folder / "many" / "report.html", "report_many.png", agent=73, keys=keys)
        browser.close()


if __name__ == "__main__":
    main()
