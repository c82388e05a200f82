"""What how-to guides and concepts show runs; tutorials run when the site is built, the tour has tests of its own."""

import re
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS / "extensions"))

import executed_pages  # noqa: E402

PAGES = [
    path
    for folder in ("how_to", "concepts")
    for path in sorted((DOCS / folder).glob("*.md"))
    if path.stem != "tour" and executed_pages.blocks_of(path.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_the_commands_and_examples_of_a_page_run(page, tmp_path):
    executed_pages.run(page, tmp_path / "pictures")


def test_there_are_pages_to_run():
    assert len(PAGES) > 10
    assert all(not re.search(r"^\.\.\.$", path.read_text(encoding="utf-8"), re.MULTILINE) for path in PAGES)
