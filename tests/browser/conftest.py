"""Reports opened in Chromium. The browser has an environment of its own: pages are made by the command line."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[2]
COMMAND = ROOT / ".venv" / "bin" / "interdrive"

#: What a page says of its run.
HEADER = re.compile(r'(<script type="application/json" id="header">)(.*?)(</script>)')
#: Height [px] of what is written in a cell.
HEIGHT = """(cell) => {
  const range = document.createRange();
  range.selectNodeContents(cell);
  return range.getBoundingClientRect().height;
}"""
#: Names under which Chromium is installed.
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def interdrive(*arguments: object) -> None:
    subprocess.run([COMMAND, *map(str, arguments), "--quiet"], check=True, timeout=300)


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of the browser."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        message = "no Chromium on the PATH: install it (apt-get install chromium) to test reports in a browser"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    return found


@pytest.fixture(scope="session")
def browser(chromium):
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-dev-shm-usage"])
        yield started
        started.close()


@pytest.fixture
def page(browser):
    """A tab of a laptop's size that fails the test if the page complains or asks for anything but itself."""
    tab = browser.new_page(viewport={"width": 1366, "height": 768})
    wrong: list[str] = []
    tab.on("console", lambda message: wrong.append(f"{message.type}: {message.text}"))
    tab.on("pageerror", lambda error: wrong.append(f"error: {error}"))
    asked: list[str] = []
    tab.on("request", lambda request: asked.append(request.url))
    yield tab
    assert wrong == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    tab.close()


@pytest.fixture(scope="session")
def demo(tmp_path_factory) -> Path:
    """Page of the T-junction, everything recorded; `frenet` has many candidates to show."""
    folder = tmp_path_factory.mktemp("demo") / "run"
    interdrive(
        "run",
        "t_junction",
        "--agents",
        "all",
        "--planner",
        "frenet",
        "--predictor",
        "lane_following",
        "--out",
        folder,
        "--report",
    )
    return folder / "report.html"


@pytest.fixture(scope="session")
def seldom(tmp_path_factory) -> Path:
    """Page of the T-junction with a new plan every half second."""
    folder = tmp_path_factory.mktemp("seldom") / "run"
    choices = ["--agents", "all", "--predictor", "constant_velocity", "--set", "step.replan_every=5"]
    interdrive("run", "t_junction", *choices, "--out", folder, "--report")
    return folder / "report.html"


@pytest.fixture(scope="session")
def crowd(tmp_path_factory) -> Path:
    """Page of a run with about 60 vehicles; of the largest shipped scenario where there are no recorded ones."""
    recorded = Path(os.environ.get("INTERDRIVE_SCENARIOS", ROOT.parent / "shared" / "scenarios"))
    file = recorded / "highway" / "USA_US101-23_1_T-1.xml"
    folder = tmp_path_factory.mktemp("crowd") / "run"
    scenario = file if file.exists() else "highway"
    interdrive("run", scenario, "--agents", "all", "--out", folder, "--report", "--set", "record.candidates=0")
    return folder / "report.html"


def opened(page, path: Path):
    """The page once it is ready; returns its root element."""
    page.goto(path.as_uri())
    page.wait_for_selector('#report[data-ready="true"]', timeout=20_000)
    return page.locator("#report")


@pytest.fixture(scope="session")
def batch(tmp_path_factory) -> Path:
    """Page of two planners on two shipped scenarios, all run folders kept."""
    folder = tmp_path_factory.mktemp("batch") / "planners #1 and 2?"
    choices = ["--planner", "frenet,idm_mobil", "--keep", "all", "--out", folder]
    interdrive("batch", "t_junction", "lane_merge", *choices)
    page = folder.parent / "page.html"
    interdrive("report", folder, "--out", page)
    return page


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Path:
    """A page in the theme and style of the documentation: a table of contents, wide table, long lines and words."""
    folder = tmp_path_factory.mktemp("site")
    cells = [f"a_long_name_of_a_column_{k}" for k in range(12)]
    rows = "\n".join("| " + " | ".join(row) + " |" for row in (cells, ["---"] * 12, ["123456.789"] * 12))
    parts = "\n\n".join(f"## A heading of the table of contents, number {k}\n\nwords" for k in range(12))
    code = f"```\ninterdrive run t_junction {'--set planner.frenet.horizon=2 ' * 12}\n```"
    (folder / "index.md").write_text(
        f"# Page\n\n{rows}\n\n{code}\n\n`{'settings.' * 20}`\n\n{parts}\n", encoding="utf-8"
    )
    style = ["html_theme=furo", f"html_static_path={ROOT / 'docs' / 'static'}", "html_css_files=site.css"]
    options = [word for option in ("extensions=myst_parser", *style) for word in ("-D", option)]
    sphinx = [ROOT / ".venv-docs" / "bin" / "python", "-m", "sphinx", "-q", "-C", "-b", "html"]
    subprocess.run([*sphinx, *options, folder, folder / "html"], check=True, timeout=120)
    return folder / "html" / "index.html"


@pytest.fixture(scope="session")
def flowing(tmp_path_factory) -> Path:
    """Page of the T-junction with generated traffic."""
    folder = tmp_path_factory.mktemp("flowing") / "run"
    traffic = "idm,rate=900,duration=30"
    choices = [
        "--agents",
        "0",
        "--traffic",
        traffic,
        "--predictor",
        "constant_velocity",
        "--set",
        "record.candidates=0",
    ]
    interdrive("run", "t_junction", *choices, "--out", folder, "--report")
    return folder / "report.html"


def header_of(page: Path) -> dict:
    return json.loads(HEADER.search(page.read_text(encoding="utf-8"))[2])


def changed(page: Path, copy: Path, change) -> Path:
    """A copy of a page with another header."""
    text = page.read_text(encoding="utf-8")
    found = HEADER.search(text)
    header = json.loads(found[2])
    change(header)
    told = json.dumps(header).replace("<", "\\u003c")
    copy.write_text(text[: found.start(2)] + told + text[found.end(2) :], encoding="utf-8")
    return copy


def ready(page) -> None:
    """Two frames later everything is drawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def headings(page, table: str) -> list[str]:
    """Of a table; every row of its body has as many cells."""
    found = page.locator(f"{table} thead th").all_inner_texts()
    rows = page.locator(f"{table} tbody tr:not(.why)")
    assert {rows.nth(k).locator("th, td").count() for k in range(rows.count())} == {len(found)}
    return found
