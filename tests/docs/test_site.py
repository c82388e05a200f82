"""What makes the site does what it says: pages are run and compared, lost links and old tables are found."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "extensions"))

import ages  # noqa: E402
import executed_pages  # noqa: E402
import links  # noqa: E402

PAGE = "# Two\n\n```python\nn = 2\n```\n\n```python\nprint(n, 'cars')\n# prints: {said}\n```\n\n{more}\n"


@pytest.fixture
def run(tmp_path):
    def run(said, more=""):
        path = tmp_path / "page.md"
        path.write_text(PAGE.format(said=said, more=more), encoding="utf-8")
        executed_pages.run(path, tmp_path / "pictures")

    return run


@pytest.mark.parametrize("said", ["2 cars", "2 ...", "... cars"])
def test_a_page_that_says_what_its_code_prints_is_accepted(run, said):
    run(said)


def test_a_page_that_says_something_else_is_refused(run):
    with pytest.raises(executed_pages.PageError, match="2 cars"):
        run("3 cars")


def test_a_picture_that_the_code_of_its_page_did_not_make_is_refused(run):
    with pytest.raises(executed_pages.PageError, match=r"left no road\.png"):
        run("2 cars", "![a road](pictures/road.png)")


def test_a_block_with_a_name_is_a_module_whose_names_have_to_be_imported(tmp_path):
    written = "```python cars.py\nn = 2\n```\n\n```python\n{first}\nprint(n)\n# prints: 2\n```\n"
    good, bad = tmp_path / "good.md", tmp_path / "bad.md"
    good.write_text(written.format(first="from cars import n"), encoding="utf-8")
    bad.write_text(written.format(first=""), encoding="utf-8")
    executed_pages.run(good, tmp_path / "pictures")
    with pytest.raises(NameError):
        executed_pages.run(bad, tmp_path / "pictures")


def test_the_site_shows_what_was_printed_in_place_of_dots(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("```python\nprint('2 cars')\n# prints: ... cars\n```\n", encoding="utf-8")
    executed_pages.run(path, tmp_path / "pictures")
    made = json.loads((tmp_path / "pictures" / "page.json").read_text())
    assert "# prints: 2 cars" in executed_pages.with_output(path.read_text(), made)


def test_a_link_to_a_missing_page_picture_or_heading_is_found(tmp_path):
    (tmp_path / "index.html").write_text('<a href="b.html#here">b</a><a href="b.html#there">b</a><img src="c.png">')
    (tmp_path / "b.html").write_text('<h1 id="here">b</h1><a href="https://example.org/x">out</a>')
    assert links.lost_in_site(tmp_path) == [
        "index.html: b.html#there: no such place in that page",
        "index.html: c.png: no such file",
    ]


@pytest.mark.parametrize("name", ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "RELEASES.md"])
def test_every_link_of_a_page_in_the_root_leads_to_a_file(name):
    assert links.lost_in_markdown(ROOT / name) == []


def test_tables_are_older_than_code_that_changed_after_they_were_measured(tmp_path):
    (tmp_path / "plan.rs").write_text("fn plan() {}")
    stored = {"name": "x", "page": "x.md", "what": "x", "command": "x", "date": "2026-01-01", "version": "0.1.0"}
    one = ages.Measured(**stored, code=("plan.rs",), sha256=ages.fingerprint(("plan.rs",), tmp_path))
    assert one.is_current(tmp_path)
    (tmp_path / "plan.rs").write_text("fn plan() { faster() }")
    assert not one.is_current(tmp_path)


def test_a_page_says_when_its_tables_were_measured():
    one = ages.stored()[0]
    page = "# Title\n\n## Speed\n\ntable\n"
    below = ages.noted(page, [replace(one, section="Speed")])
    assert below.index("## Speed") < below.index(f"Measured on {one.date} with interdrive {one.version}")
    above = ages.noted(page, [replace(one, section="")])
    assert above.index("Measured on") < above.index("## Speed")
    with pytest.raises(SystemExit, match="has a section 'Nothing'"):
        ages.noted(page, [replace(one, section="Nothing")])


def test_a_comment_does_not_make_tables_old(tmp_path):
    (tmp_path / "plan.rs").write_text("fn plan() {}\n")
    before = ages.fingerprint(("plan.rs",), tmp_path)
    (tmp_path / "plan.rs").write_text("// Plans.\nfn plan() {}\n")
    assert ages.fingerprint(("plan.rs",), tmp_path) == before


def test_every_page_of_research_says_when_it_was_measured():
    dated_in_words = {"index", "ages", "oracles"}
    pages = {path.stem for path in (ROOT / "docs" / "research").glob("*.md")} - dated_in_words
    assert {f"research/{page}.md" for page in pages} <= {one.page for one in ages.stored()}


def test_every_page_is_in_the_index_of_its_folder():
    for folder in ("tutorials", "how_to", "concepts", "reference", "research", "research/log", "development"):
        index = (ROOT / "docs" / folder / "index.md").read_text(encoding="utf-8").splitlines()
        pages = {path.stem for path in (ROOT / "docs" / folder).glob("*.md")} - {"index"}
        assert pages - {"ages"} <= set(index), folder


def test_the_code_of_all_measured_tables_is_there():
    assert all(len(ages.fingerprint(one.code)) == 64 for one in ages.stored())
    assert all((ROOT / "docs" / one.page).is_file() for one in ages.stored())
