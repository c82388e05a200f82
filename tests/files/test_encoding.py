"""XML is read in every encoding that it can state, and bytes outside it are named."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from interdrive.cli import main
from interdrive.errors import InputError
from interdrive.files import read_scenario, shipped_scenario

BODY = shipped_scenario("t_junction").read_text("utf-8").split("?>", 1)[1]


def written(folder, encoding, codec=None, author="Björn", declared=True):
    head = f'<?xml version="1.0" encoding="{encoding}"?>' if declared else "<?xml version='1.0'?>"
    path = folder / "map.xml"
    path.write_bytes((head + "\n" + BODY.replace('author="', f'author="{author} ', 1)).encode(codec or encoding))
    return path


@pytest.mark.parametrize(
    ("encoding", "codec", "author"),
    [
        ("ISO-8859-1", None, "Björn"),
        ("latin1", None, "Björn"),
        ("Windows-1252", None, "“Björn”"),
        ("ISO-8859-15", None, "5 €"),
        ("KOI8-R", None, "Жуков"),
        ("Shift_JIS", None, "日本"),
        ("GB18030", None, "北京"),
        ("EUC-JP", None, "日本"),
        ("UTF-16", None, "日本"),
        ("UTF-16", "utf-16-be", "日本"),
        ("UTF-32", None, "Björn"),
        ("UTF-8", "utf-8-sig", "Björn"),
        ("IBM037", None, "Bjorn"),
        ("us-ascii", None, "Bjorn"),
    ],
)
def test_a_stated_encoding_is_read(tmp_path, encoding, codec, author):
    scenario = read_scenario(written(tmp_path, encoding, codec, author))
    assert len(scenario.lanelets.ids) == len(read_scenario(shipped_scenario("t_junction")).lanelets.ids)


def test_text_without_a_stated_encoding_is_utf_8(tmp_path):
    assert read_scenario(written(tmp_path, "utf-8", declared=False)).dt == 0.1


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ({"encoding": "UTF-8", "codec": "latin-1", "author": "Öz"}, "byte 214 at line 3 is not UTF-8; correct it"),
        ({"encoding": "", "codec": "latin-1", "author": "Öz", "declared": False}, "byte 214 at line 3 is not UTF-8"),
        ({"encoding": "US-ASCII", "codec": "utf-8", "author": "Öz"}, "byte 195 at line 3 is not US-ASCII; correct it"),
        ({"encoding": "Shift_JIS", "codec": "latin-1", "author": "ÿ"}, "byte 255 at line 3 is not SHIFT_JIS"),
        ({"encoding": "klingon", "codec": "latin-1"}, "states the encoding klingon, which is not known"),
        ({"encoding": "base64", "codec": "latin-1"}, "states the encoding base64, which is not known"),
        ({"encoding": "UTF-16", "codec": "latin-1"}, "states the encoding UTF-16, but is not in it"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("command", ["run", "check"])
def test_a_byte_or_encoding_that_cannot_be_read_is_named_with_its_line(tmp_path, path, message, command):
    file = written(tmp_path, **path)
    with pytest.raises(InputError, match=message):
        read_scenario(file)
    outcome = CliRunner().invoke(main, [command, str(file), *(["--out", str(tmp_path / "o")] * (command == "run"))])
    assert outcome.exit_code == 2
    assert message in " ".join(outcome.output.split())


def test_bytes_that_are_no_text_at_all_are_no_xml_file(tmp_path):
    (tmp_path / "map.xml").write_bytes(bytes(range(128, 256)) * 4)
    with pytest.raises(InputError, match="not an XML file"):
        read_scenario(tmp_path / "map.xml")


def test_a_document_type_is_refused_in_every_encoding(tmp_path):
    bomb = "<?xml version='1.0' encoding='UTF-16'?><!DOCTYPE a [<!ENTITY b 'c'>]><commonRoad/>"
    (tmp_path / "map.xml").write_bytes(bomb.encode("utf-16"))
    with pytest.raises(InputError, match="document type"):
        read_scenario(tmp_path / "map.xml")
