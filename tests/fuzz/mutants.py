"""Mutant number `index` of a seed: which document it comes from, and the files that it consists of."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

from tests.fuzz import document, protobuf
from tests.fuzz.seeds import to_be_protobuf

from interdrive.files.read import quiet

if TYPE_CHECKING:
    from google.protobuf.message import Message

#: Share of mutants that are protobuf messages.
PROTOBUF_SHARE = 0.25
#: Share of XML mutants that come from further documents.
OTHERS_SHARE = 0.25
_NAME = "ZAM_Merge-1_1_T-1"


@dataclass(frozen=True)
class Mutant:
    """Files of a mutant, and the random numbers that the rest of its trial may draw.

    Attributes:
        kind: "xml", "protobuf", or "source" and the format of another tool.
        main: Name of the file that is opened; "": the folder.
        files: Content by file name.
        random: Continues after the mutation.
        options: Of a source.
    """

    kind: str
    main: str
    files: dict[str, bytes]
    random: Random
    options: dict[str, str] = field(default_factory=dict)


def mutant(seed: int, index: int, documents: tuple[bytes, ...], others: tuple[bytes, ...] = ()) -> Mutant:
    """The mutant; the same for the same seed, index and documents.

    Args:
        seed: Of the whole campaign.
        index: Of the mutant in it.
        documents: Well-formed XML documents that are accepted.
        others: Further well-formed ones, many of which may be refused; less often changed therefore.
    """
    random = Random(f"{seed}:{index}")
    if random.random() < PROTOBUF_SHARE:
        parts = dict(_protobuf_parts(random.choice(to_be_protobuf())))
        messages = _parsed(parts)
        for name in random.sample(sorted(messages), random.choice((1, 1, 2))):
            protobuf.mutated(messages[name], random)
            parts[name] = messages[name].SerializePartialToString()
        if random.random() < 1 / 12:
            name = random.choice(sorted(parts))
            cut = random.randrange(len(parts[name]) + 1)
            parts[name] = parts[name][:cut] + bytes([random.randrange(256)]) + parts[name][cut + 1 :]
        return Mutant("protobuf", f"{_NAME}.pb", parts, random)
    # Drawn apart, so that all other mutants are the same with these documents and without.
    apart = Random(f"{seed}:{index}:others")
    chosen = random.choice(documents)
    if others and apart.random() < OTHERS_SHARE:
        chosen = apart.choice(others)
    data = document.mutated(chosen, random, documents)
    return Mutant("xml", "mutant.xml", {"mutant.xml": data}, random)


@cache
def _protobuf_parts(xml: bytes) -> dict[str, bytes]:
    """A document as commonroad-io writes it in protobuf: traffic, planning problems and map."""
    from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
    from commonroad.common.reader.file_reader_xml import XMLFileReader
    from commonroad.common.util import FileFormat

    with quiet("seed"), tempfile.TemporaryDirectory() as folder:
        scenario, problems = XMLFileReader(xml).open()
        writer = CommonRoadFileWriter(scenario, problems, "a", "b", "c", set(), file_format=FileFormat.PROTOBUF)
        always = OverwriteExistingFile.ALWAYS
        writer.write_map_to_file(str(Path(folder, "ZAM_Merge-1.pb")), always)
        writer.write_dynamic_to_file(str(Path(folder, f"{_NAME}.pb")), always)
        writer.write_scenario_to_file(str(Path(folder, f"{_NAME}-SC.pb")), always)
        return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


def _parsed(parts: dict[str, bytes]) -> dict[str, Message]:
    from commonroad.common.protobuf.dynamic.commonroad_dynamic_pb2 import CommonRoadDynamic
    from commonroad.common.protobuf.map.commonroad_map_pb2 import CommonRoadMap
    from commonroad.common.protobuf.scenario.commonroad_scenario_pb2 import CommonRoadScenario

    kinds = {"ZAM_Merge-1.pb": CommonRoadMap, f"{_NAME}.pb": CommonRoadDynamic, f"{_NAME}-SC.pb": CommonRoadScenario}
    return {name: kinds[name].FromString(data) for name, data in parts.items()}
