"""How a table came about: settings, version and inputs, which every table that is written carries.

In Parquet they are metadata of the schema, in text formats lines before the table.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any

from interdrive import _core
from interdrive.storage.reading import parsed_json
from interdrive.storage.writing import json_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

#: Keys of the metadata.
VERSION, SETTINGS, INPUTS, UNIT = b"interdrive", b"settings", b"inputs", b"unit"


@dataclass(frozen=True)
class Origin:
    """How a table came about.

    Attributes:
        settings: What differs from the defaults, by dotted names.
        inputs: SHA-256 of what the table was made from, by name.
        version: Version of interdrive.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    version: str = _core.__version__

    def marked(self, table: pa.Table) -> pa.Table:
        """The same table with this origin as metadata of its schema."""
        return table.replace_schema_metadata(self.metadata())

    def metadata(self) -> dict[bytes, bytes]:
        """The origin as metadata of a schema."""
        plain = {SETTINGS: dict(sorted(self.settings.items())), INPUTS: dict(sorted(self.inputs.items()))}
        return {VERSION: self.version.encode(), **{key: json_text(value).encode() for key, value in plain.items()}}

    @property
    def lines(self) -> tuple[str, ...]:
        """The origin in words, for text formats."""
        settings = ", ".join(f"{name}={_plain(value)}" for name, value in sorted(self.settings.items()))
        inputs = ", ".join(f"{name} {digest}" for name, digest in sorted(self.inputs.items()))
        return (
            f"interdrive {self.version}",
            f"settings that differ from the defaults: {settings or 'none'}",
            f"SHA-256 of inputs: {inputs or 'none'}",
        )


def origin_of(table: pa.Table) -> Origin | None:
    """The origin of a table that was read; None if it states none, as those of older versions."""
    told = table.schema.metadata or {}
    try:
        settings, inputs = (parsed_json(told[key].decode()) for key in (SETTINGS, INPUTS))
        return Origin(settings, inputs, told[VERSION].decode())
    except (KeyError, ValueError):
        return None


def is_of(table: pa.Table, digest: str) -> bool:
    """Whether a table that was read is of the run with these states; those of older versions do not say."""
    told = origin_of(table)
    return told is None or told.inputs.get("run", digest) == digest


def units_of(schema: pa.Schema) -> dict[str, str]:
    """The unit of each column that has one; "1" for a number without unit."""
    units = {one.name: (one.metadata or {}).get(UNIT, b"").decode() for one in schema}
    return {name: unit for name, unit in units.items() if unit}


def changed_settings(record: object, above: str = "") -> dict[str, Any]:
    """The fields of a record of settings that differ from its defaults, by dotted names.

    Args:
        record: An instance of a dataclass whose fields all have defaults.
        above: What its fields belong to, with a point at the end.
    """
    usual, found = type(record)(), dict[str, Any]()
    for one in fields(record):  # type: ignore[arg-type]
        value = getattr(record, one.name)
        if is_dataclass(value) and not isinstance(value, type):
            found |= changed_settings(value, f"{above}{one.name}.")
        elif value != getattr(usual, one.name):
            found[f"{above}{one.name}"] = value
    return found


def _plain(value: object) -> str:
    return value if isinstance(value, str) else json_text(value)
