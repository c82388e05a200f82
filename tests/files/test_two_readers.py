"""What the core reads of a document is what commonroad-io, the reference of the format, reads, or both refuse it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from random import Random
from xml.etree.ElementTree import tostring

import pytest
from test_messages import DOCUMENT_2018B, DOCUMENT_2020A, broken
from tests.fuzz.document import mutated
from tests.fuzz.seeds import documents
from two_readers import disagreements

from interdrive.files.read import read_document

MUTANTS = 300
#: Larger files take commonroad-io too long [bytes].
LARGE = 1_000_000


@pytest.mark.long
@pytest.mark.parametrize("part", range(4))
def test_mutated_documents_are_read_alike(part):
    seeds = documents()
    for index in range(part, MUTANTS, 4):
        random = Random(f"readers:{index}")
        data = mutated(random.choice(seeds), random, seeds)
        assert disagreements(data, f"mutant {index}") == [], index


@pytest.mark.long
@pytest.mark.parametrize("text", [DOCUMENT_2020A, DOCUMENT_2018B], ids=["2020a", "2018b"])
def test_documents_with_one_mistake_are_read_alike(text):
    for what, root in broken(text):
        assert disagreements(tostring(root), "mistake") == [], what


def test_recorded_scenarios_are_read_alike(recorded_scenarios, scenarios_folder):
    paths = [scenarios_folder / name for name in recorded_scenarios]
    small = [path for path in paths if path.stat().st_size < LARGE]
    assert len(small) > 50
    for path in small:
        assert disagreements(path.read_bytes(), path.name) == [], path


def test_a_disagreement_would_be_seen(monkeypatch):
    _, _, old, plain, *_ = documents()
    assert disagreements(plain, "plain") == []
    monkeypatch.setattr("two_readers.read_by_commonroad_io", lambda _, file: read_document(old, file, raw=True))
    assert ".dt" not in disagreements(plain, "plain")
    assert any(".lanelets.speed_limit" in place for place in disagreements(plain, "plain"))


def test_a_run_of_an_xml_file_needs_no_commonroad_io(tmp_path):
    path = Path(tmp_path, "some.xml")
    path.write_bytes(documents()[3])
    code = (
        "import sys; sys.modules['commonroad'] = None\n"
        "import interdrive as idr; run = idr.simulate(sys.argv[1], agents='all'); idr.save(run, sys.argv[2])"
    )
    words = [sys.executable, "-c", code, str(path), str(tmp_path / "made")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
