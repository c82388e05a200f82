"""The report in a real browser: nothing is cut or scrolls sideways, tables have only columns with content."""

from __future__ import annotations

import pytest

from conftest import changed, headings, opened, ready


def test_reasons_of_agents_use_the_width_of_the_panel(page, demo, tmp_path):
    reason = "stood for 9.3 s while 603 crossed its path; 5.0 m before the goal area when the time was over"

    def late(header):
        header["participants"][0] |= {"reason": reason, "harm": None}

    opened(page, changed(demo, tmp_path / "late.html", late))
    cell = page.locator("tr.why td").first
    assert cell.inner_text() == reason
    assert cell.bounding_box()["height"] < 60, "two or three lines"


@pytest.mark.parametrize("size", [{"width": 1280, "height": 720}, {"width": 1024, "height": 768}])
def test_larger_text_leaves_values_whole_and_the_map_in_sight(page, demo, size):
    page.set_viewport_size(size)
    opened(page, demo)
    page.locator('button[aria-label="Select agent 1002"]').click()
    page.keyboard.press("A")
    page.keyboard.press("A")
    page.locator(".scrub").fill("60")
    ready(page)
    values = page.locator(".profile .value").all()
    assert len(values) > 2
    for value in values:
        assert value.evaluate("(v) => v.scrollWidth <= v.clientWidth"), value.inner_text()
    assert page.locator(".side").bounding_box()["width"] <= 0.35 * size["width"]
    assert page.locator(".map").bounding_box()["height"] >= 0.25 * size["height"]
    assert page.evaluate("() => document.documentElement.scrollHeight <= window.innerHeight")


#: Widths [px] of a phone, a half screen and a tablet; where the site changes its columns; of screens.
WIDTHS = [390, 623, 768, 1313, 1366, 1440, 1471, 1920]


def needed_width(page) -> int:
    """Width [px] in which nothing of a page would be outside."""
    return page.evaluate("document.documentElement.scrollWidth")


@pytest.mark.parametrize("width", WIDTHS)
def test_no_page_scrolls_sideways(page, demo, batch, width):
    page.set_viewport_size({"width": width, "height": 800})
    for file in (demo, batch):
        opened(page, file)
        assert needed_width(page) <= width, file


@pytest.mark.parametrize("width", WIDTHS)
def test_pages_of_the_site_fit_beside_their_table_of_contents(page, site, width):
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(site.as_uri())
    assert needed_width(page) <= width
    article, contents = (page.locator(name).bounding_box() for name in ("article", ".toc-drawer"))
    if contents["x"] < width:
        assert article["x"] + article["width"] <= contents["x"]


def test_the_side_panel_shows_its_table_whole_on_a_laptop(page, demo):
    page.set_viewport_size({"width": 1400, "height": 800})
    opened(page, demo)
    assert page.locator(".side").evaluate("(side) => side.scrollWidth <= side.clientWidth")
    for cell in page.locator("tr[data-agent] td.number").all():
        assert cell.evaluate("(cell) => cell.scrollWidth <= cell.clientWidth"), cell.inner_text()


def test_a_run_in_which_no_agent_follows_another_has_no_column_for_it(page, demo, tmp_path):
    def alone(header):
        for one in header["participants"]:
            one.pop("ttc", None)

    opened(page, demo)
    assert headings(page, ".page table:has([data-agent])")[:4] == ["agent", "outcome", "time [s]", "TTC [s]"]
    opened(page, changed(demo, tmp_path / "alone.html", alone))
    assert headings(page, ".page table:has([data-agent])")[:3] == ["agent", "outcome", "time [s]"]
    assert "TTC [s]" not in headings(page, ".page table:has([data-agent])")


def test_a_batch_has_no_columns_without_content_and_still_sorts(page, batch, tmp_path):
    def bare(header):
        for run in header["runs"]:
            run.update(category="", ttc="", ttc_min=None)

    copy = changed(batch, batch.parent / "bare.html", bare)
    opened(page, copy)
    assert headings(page, ".runs") == ["scenario", "planner", "seed", "status", "agents", "reached %", "collisions", ""]
    planners = page.locator(".runs tbody tr td:nth-child(2)")
    page.get_by_role("button", name="Sort by planner").click()
    assert planners.all_inner_texts() == sorted(planners.all_inner_texts())
    page.get_by_role("button", name="Sort by planner").click()
    assert planners.all_inner_texts() == sorted(planners.all_inner_texts(), reverse=True)
