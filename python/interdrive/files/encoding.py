"""Text of XML documents in the encoding that they state or begin with."""

from __future__ import annotations

import codecs
import re

from interdrive.errors import InputError

#: How documents without a mark of their byte order begin, unless their declaration is readable as ASCII.
_BEGINNINGS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    ("<".encode("utf-32-le"), "utf-32-le"),
    ("<".encode("utf-32-be"), "utf-32-be"),
    ("<".encode("utf-16-le"), "utf-16-le"),
    ("<".encode("utf-16-be"), "utf-16-be"),
)
#: The declaration in EBCDIC, where only the encoding that it states tells the rest.
_EBCDIC = "<?xm".encode("cp037")
_DECLARED = re.compile(r"""<\?xml\s[^>]*?\bencoding\s*=\s*["']([A-Za-z][A-Za-z0-9._:-]*)["']""")
#: The declaration is in the first bytes.
_HEAD = 400
#: Codecs of Python that turn text into text.
_NO_CHARSETS = ("idna", "punycode", "unicode_escape", "raw_unicode_escape", "undefined")


def text_of(data: bytes, file: str) -> str:
    """The text of an XML document.

    Args:
        data: The document.
        file: Its name, for messages.

    Raises:
        InputError: The encoding is not known, or a byte is not part of it; the message names byte and line.
    """
    encoding, is_stated = _encoding(data, file)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == "utf-8" and not data.lstrip().startswith(b"<"):
            raise InputError(f"{file}: not an XML file; give a CommonRoad .xml or .pb file") from error
        line = data[: error.start].decode(encoding, "replace").count("\n") + 1
        named = encoding.upper().removesuffix("-SIG")
        advice = (
            f"correct it, or the encoding {named} in the first line"
            if is_stated
            else f"save the file as {named}, or state its encoding in the first line, as in "
            "<?xml version='1.0' encoding='ISO-8859-1'?>"
        )
        raise InputError(f"{file}: byte {data[error.start]} at line {line} is not {named}; {advice}") from error


def _encoding(data: bytes, file: str) -> tuple[str, bool]:
    """Name of the codec, and whether the document states it."""
    for beginning, encoding in _BEGINNINGS:
        if data.startswith(beginning):
            return encoding, False
    found = _DECLARED.match(data[:_HEAD].decode("cp037" if data.startswith(_EBCDIC) else "latin-1").lstrip())
    if found is None:
        return "utf-8", False
    stated = found[1]
    try:
        name = codecs.lookup(stated).name
        "".encode(stated)  # refuses codecs that do not make bytes of text
    except (LookupError, UnicodeError):
        name = ""
    if not name or name in _NO_CHARSETS:
        raise InputError(f"{file}: states the encoding {stated}, which is not known; save it as UTF-8")
    if name.startswith(("utf-16", "utf-32")):
        raise InputError(f"{file}: states the encoding {stated}, but is not in it; save it as UTF-8")
    return stated.lower(), True
