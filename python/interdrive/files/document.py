"""XML documents as trees of elements, where parts of them are written again."""

from __future__ import annotations

import contextlib
import re
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError, fromstring
from xml.parsers import expat

from interdrive.errors import InputError
from interdrive.files.encoding import text_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from xml.etree.ElementTree import Element

#: Errors of documents that end too early, by their numbers in expat.
_CUT = tuple(
    expat.errors.codes[text]
    for text in (
        expat.errors.XML_ERROR_NO_ELEMENTS,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN,
        expat.errors.XML_ERROR_PARTIAL_CHAR,
        expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
    )
)


#: What encloses text that may look like elements.
_ENCLOSING = ("<!--", "<![CDATA[", "<?")

#: Attributes of an element, whose values may have any character but "<".
_ATTRIBUTES = r"""(?:\s+[^\s<>"'=/]+\s*=\s*(?:"[^"<]*"|'[^'<]*'))*"""


def parse(data: bytes, file: str, but: Sequence[str] = ()) -> Element:
    """Parses an XML document without entities, document types or external references.

    Args:
        data: The document.
        file: Its name, for messages.
        but: Tags of elements that may be left out, which saves time; none of them is inside of another one.

    Returns:
        The root element.

    Raises:
        InputError: The document is not XML, is truncated, or has a document type declaration (entities, XML bombs).
    """
    if not data.strip():
        raise InputError(f"{file}: the file is empty; give a CommonRoad file")
    text = text_of(data, file)
    try:
        if _has_document_type(text):
            raise InputError(
                f"{file}: has a document type declaration or entities, refused for safety; remove the <!DOCTYPE ...>"
            )
        root = fromstring(_without(text, but))
    except (ParseError, expat.ExpatError, ValueError) as error:
        if not text.lstrip().startswith("<"):
            raise InputError(f"{file}: not an XML file; give a CommonRoad .xml or .pb file") from error
        is_cut = getattr(error, "code", None) in _CUT
        advice = "is the file complete?" if is_cut else "correct the file there"
        raise InputError(f"{file}: broken XML ({error}); {advice}") from error
    return root


def _without(text: str, tags: Sequence[str]) -> str:
    """The document without elements that are easy to find; the others stay."""
    begin = text.find("?>") + 1 if text.lstrip().startswith("<?xml") else 0
    if any(text.find(mark, begin) >= 0 for mark in _ENCLOSING):
        return text
    for tag in tags:
        text = re.sub(rf"<{tag}{_ATTRIBUTES}\s*>.*?</{tag}\s*>", "", text, flags=re.DOTALL)
    return text


class _PrologueRead(Exception):  # noqa: N818 - the parser is left by raising
    """Ends the parser once it is known whether there is a document type declaration."""


def _has_document_type(text: str) -> bool:
    """Whether there is a document type declaration, the only place of entities; the rest is not parsed.

    Raises:
        xml.parsers.expat.ExpatError: The parsed part is not XML.
    """
    found = []

    def declared(*_: str | int | None) -> None:
        found.append(True)
        raise _PrologueRead

    def begun(*_: str | dict[str, str]) -> None:
        raise _PrologueRead

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler, parser.StartElementHandler = declared, begun
    with contextlib.suppress(_PrologueRead):
        parser.Parse(text, True)
    return bool(found)


def drop_dangling_relations(root: Element) -> None:
    """Removes relations to lanelets that do not exist, as in maps that were cut out of larger ones."""
    known = {int(lanelet.get("id", "-1")) for lanelet in root.iterfind("lanelet")}
    for lanelet in root.iterfind("lanelet"):
        for tag in ("predecessor", "successor", "adjacentLeft", "adjacentRight"):
            for relation in lanelet.findall(tag):
                if int(relation.get("ref", "-1")) not in known:
                    lanelet.remove(relation)
