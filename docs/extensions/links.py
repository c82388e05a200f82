"""Checks all links between files: python docs/extensions/links.py SITE MARKDOWN...

In the site every link to a page, picture or heading must lead somewhere; in Markdown files every link to a file. What
lies on other machines is not asked for.
"""

from __future__ import annotations

import re
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """Links and places of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keeps what is linked, and what can be."""
        for name, value in attrs:
            if name == "id" and value:
                self.places.add(value)
            if value and (tag, name) in {("a", "href"), ("img", "src"), ("link", "href"), ("script", "src")}:
                self.links.append(value)


@cache
def read(path: Path) -> _Page:
    """A page of the site."""
    page = _Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def lost_in_site(site: Path) -> list[str]:
    """Links of all pages that lead nowhere."""
    found = []
    for path in sorted(site.rglob("*.html")):
        for link in read(path).links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                found.append(f"{path.relative_to(site)}: {link}: no such file")
            elif parts.fragment and target.suffix == ".html" and unquote(parts.fragment) not in read(target).places:
                found.append(f"{path.relative_to(site)}: {link}: no such place in that page")
    return found


def lost_in_markdown(path: Path) -> list[str]:
    """Links of a Markdown file to files that are not there."""
    links = re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8"))
    inside = (urlsplit(link) for link in links)
    return [
        f"{path}: {link.path}: no such file"
        for link in inside
        if not link.scheme and link.path and not (path.parent / unquote(link.path)).exists()
    ]


def main() -> int:
    """The command; its exit code."""
    site, *files = map(Path, sys.argv[1:])
    if not (site / "index.html").is_file():
        sys.exit(f"{site}: no site")
    lost = [*lost_in_site(site), *(one for path in files for one in lost_in_markdown(path))]
    print(*lost, sep="\n", end="\n" if lost else "")
    return int(bool(lost))


if __name__ == "__main__":
    sys.exit(main())
