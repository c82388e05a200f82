"""Opens files of unknown formats: unpacks them, finds the root of XML, and keeps the hashes of all that is read."""

from __future__ import annotations

import contextlib
import hashlib
import zlib
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, ParseError, fromstring
from xml.parsers import expat

from interdrive.errors import InputError
from interdrive.files.content import content_of_input

if TYPE_CHECKING:
    import os
    from typing import Self

#: Largest content of a file, once unpacked.
_LARGEST = 512 * 2**20
_GZIP = b"\x1f\x8b"
_LFS = b"version https://git-lfs"
#: Nesting depth of an XML document.
_DEEPEST = 256
#: The root is looked for in pieces of this size.
_PIECE = 2**16


class SourceFile:
    """A file, or a folder, of which a format has to be recognised.

    Attributes:
        path: As given.
        is_folder: Whether it is a folder; its `data` are empty then.
        data: Content, unpacked if it was compressed by gzip.
        is_packed: Whether it was.
        root: Name of the root element of XML without its namespace; empty: it is no XML.
        files: Name and SHA-256 of every file that was read, this one first; names are paths from its folder.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.is_folder = self.path.is_dir()
        self._hashes: dict[str, str] = {}
        self.is_packed = False
        self.data = b"" if self.is_folder else self._content(self.path)
        self._has_document_type = False
        self.root = self._root()

    @classmethod
    def within(cls, path: Path, data: bytes) -> Self:
        """A document that is a part of a file, which messages name."""
        part = cls.__new__(cls)
        part.path, part.is_folder, part.is_packed = path, False, False
        part.data, part._hashes, part._has_document_type = data, {}, False
        part.root = part._root()
        return part

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """Name and SHA-256 of every file that was read."""
        return tuple(self._hashes.items())

    def beside(self, name: str) -> bytes:
        """Content of a file in the same folder, or below the folder that was given.

        Raises:
            InputError: It is not there, or cannot be read.
        """
        path = (self.path if self.is_folder else self.path.parent) / name
        if not path.is_file():
            raise InputError(f"{self.path}: {name} is not {'in' if self.is_folder else 'beside'} it; put it there")
        return self._content(path)

    def names(self, pattern: str) -> list[str]:
        """Names of files in the same folder, or in the folder that was given, that match a pattern; sorted."""
        folder = self.path if self.is_folder else self.path.parent
        return sorted(path.name for path in folder.glob(pattern) if path.is_file())

    def document(self) -> Element:
        """The root element of XML; namespaces are removed from the names of elements.

        Raises:
            InputError: The XML is broken, nested too deeply, or has a document type.
        """
        if self._has_document_type:
            raise InputError(f"{self.path}: has a document type, which may expand without end; remove it")
        try:
            root = fromstring(self.data)
        except ParseError as error:
            line, column = error.position
            raise InputError(
                f"{self.path}: line {line}, column {column + 1}: {_reason(error)}; give a whole file"
            ) from error
        except (ValueError, LookupError) as error:
            raise InputError(f"{self.path}: its encoding is not known; save it as UTF-8") from error
        level, depth = [root], 0
        while level:
            depth += 1
            if depth > _DEEPEST:
                raise InputError(f"{self.path}: is nested more than {_DEEPEST} elements deep; is the file damaged?")
            level = [child for element in level for child in element]
        if root.tag.startswith("{"):
            for element in root.iter():
                element.tag = _local(element.tag)
        return root

    def _content(self, path: Path) -> bytes:
        packed = content_of_input(path)
        if packed.startswith(_LFS):
            raise InputError(f"{path}: is a Git LFS pointer, not the data; run git lfs pull")
        is_main = not self._hashes
        name = path.name if path.parent == self.path.parent else str(path.relative_to(self.path))
        self._hashes[name] = hashlib.sha256(packed).hexdigest()
        if not packed.startswith(_GZIP):
            if len(packed) > _LARGEST:
                raise InputError(f"{path}: has more than 512 MB; cut it")
            return packed
        self.is_packed |= is_main
        return unpacked(packed, str(path))

    def _root(self) -> str:
        parser, found = expat.ParserCreate(), []

        def begun(name: str, _: object) -> None:
            found.append(name)
            raise _RootRead

        def declared(*_: str | int | None) -> None:
            self._has_document_type = True

        parser.StartElementHandler, parser.StartDoctypeDeclHandler = begun, declared
        # Entities are not expanded: the parser is left at the first element.
        with contextlib.suppress(_RootRead, expat.ExpatError, ValueError, LookupError):
            for at in range(0, len(self.data), _PIECE):
                parser.Parse(self.data[at : at + _PIECE])
        return _local(found[0].replace(":", "}")) if found else ""


class _RootRead(Exception):  # noqa: N818 - the parser is left by raising
    """Ends the parser at the first element."""


def content_sha256(path: Path) -> str:
    """SHA-256 of a file, or of the names and hashes of the files in a folder.

    Raises:
        InputError: One cannot be read.
    """
    if not path.is_dir():
        return hashlib.sha256(content_of_input(path)).hexdigest()
    inner = sorted(one for one in path.iterdir() if one.is_file())
    listed = "\n".join(f"{one.name} {hashlib.sha256(content_of_input(one)).hexdigest()}" for one in inner)
    return hashlib.sha256(listed.encode()).hexdigest()


def unpacked(packed: bytes, file: str) -> bytes:
    """The content of a file that was compressed by gzip, in one or several members."""
    parts, size = [], 0
    while packed:
        unpacker = zlib.decompressobj(wbits=31)
        try:
            part = unpacker.decompress(packed, _LARGEST - size + 1)
        except zlib.error as error:
            raise InputError(f"{file}: compressed data are damaged; fetch the file again") from error
        size += len(part)
        if size > _LARGEST:
            raise InputError(f"{file}: unpacks to more than 512 MB; cut it")
        if not unpacker.eof:
            raise InputError(f"{file}: compressed data end early; fetch the file again")
        parts.append(part)
        packed = unpacker.unused_data.lstrip(b"\0")
    return b"".join(parts)


def _local(name: str) -> str:
    return name.rpartition("}")[2]


def _reason(error: ParseError) -> str:
    text = str(error).split(":")[0]
    return "not well-formed" if "not well-formed" in text else text
