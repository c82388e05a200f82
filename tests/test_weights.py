"""Weights: safetensors files, checkpoints of torch without torch, and how published weights get into the cache."""

from __future__ import annotations

import dataclasses
import io
import os
import pickle
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from interdrive.cli import main
from interdrive.errors import InputError
from interdrive.predictors import models
from interdrive.predictors.checkpoint import MAGIC, PROTOCOL, read_checkpoint
from interdrive.predictors.weights import cache_folder, digest, read_weights, write_weights

TENSORS = {"a.weight": np.arange(6, dtype=np.float32).reshape(2, 3), "a.bias": np.array([0.5, -1.0], np.float32)}
SHAPES = {"a.weight": (2, 3), "a.bias": (2,)}


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("INTERDRIVE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "net.safetensors"
    write_weights(path, TENSORS, {"made by": "a test"})
    return path


def test_weights_come_back_as_they_were_written(file):
    found = read_weights(file, SHAPES, digest(TENSORS))
    assert found.metadata == {"made by": "a test"}
    assert {name: values.tolist() for name, values in found.tensors.items()} == {
        name: values.tolist() for name, values in TENSORS.items()
    }
    assert not any(values.flags.writeable for values in found.tensors.values())


def test_nothing_is_left_beside_a_written_file(file):
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.parametrize("length", [0, 5, 60, -1])
def test_a_truncated_file_is_refused_by_its_name(file, length):
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(InputError, match=r"weights .*net\.safetensors: damaged"):
        read_weights(file, SHAPES)


@pytest.mark.parametrize(
    ("tensors", "words"),
    [
        ({"a.weight": TENSORS["a.weight"]}, "tensor a.bias is missing"),
        ({**TENSORS, "b": np.zeros(1, np.float32)}, "unknown tensor b"),
        ({**TENSORS, "a.bias": np.zeros(3, np.float32)}, r"a.bias has shape \(3,\), \(2,\) is expected"),
        ({**TENSORS, "a.bias": np.array([0.0, np.nan], np.float32)}, "a.bias has values that are not finite"),
        ({**TENSORS, "a.bias": np.array([0.5, -1.5], np.float32)}, "not those expected"),
    ],
)
def test_other_tensors_than_expected_are_refused(file, tensors, words):
    write_weights(file, tensors, {})
    with pytest.raises(InputError, match=words):
        read_weights(file, SHAPES, digest(TENSORS))


def test_a_type_that_numpy_does_not_have_is_refused(file):
    header = b'{"a":{"dtype":"F8_E4M3","shape":[1],"data_offsets":[0,1]}}'
    file.write_bytes(struct.pack("<Q", len(header)) + header + b"0")
    with pytest.raises(InputError, match="damaged or not a safetensors file"):
        read_weights(file)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.safetensors: no such file"):
        read_weights(tmp_path / "nowhere.safetensors")


def test_the_digest_depends_on_names_shapes_and_values_but_not_on_their_order():
    assert digest(dict(reversed(TENSORS.items()))) == digest(TENSORS)
    assert digest({**TENSORS, "a.weight": TENSORS["a.weight"].reshape(3, 2)}) != digest(TENSORS)
    assert digest({"c" + name: values for name, values in TENSORS.items()}) != digest(TENSORS)


def test_the_cache_is_where_the_user_or_the_desktop_wants_it(monkeypatch):
    monkeypatch.setenv("INTERDRIVE_CACHE", "/somewhere")
    assert cache_folder() == Path("/somewhere")
    monkeypatch.delenv("INTERDRIVE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/caches")
    assert cache_folder() == Path("/caches/interdrive")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert cache_folder() == Path("/home/somebody/.cache/interdrive")


# A checkpoint as torch wrote it until 1.5, with opcodes written by hand: nothing here needs torch.


def text(value: str) -> bytes:
    return b"X" + struct.pack("<I", len(value.encode())) + value.encode()


def number(value: int) -> bytes:
    return b"M" + struct.pack("<H", value)


def tensor(storage: str, count: int, offset: int, shape: tuple[int, ...], strides: tuple[int, ...]) -> bytes:
    persistent = (
        b"(" + text("storage") + b"ctorch\nFloatStorage\n" + text(storage) + text("cuda:0") + number(count) + b"NtQ"
    )
    sizes = b"".join(b"(" + b"".join(map(number, numbers)) + b"t" for numbers in (shape, strides))
    hooks = b"ccollections\nOrderedDict\n)R"
    return b"ctorch._utils\n_rebuild_tensor_v2\n(" + persistent + number(offset) + sizes + b"\x89" + hooks + b"tR"


def named(*tensors: tuple[str, bytes]) -> bytes:
    return b"\x80\x02ccollections\nOrderedDict\n)R(" + b"".join(text(name) + piece for name, piece in tensors) + b"u."


def checkpoint(dictionary: bytes, storages: dict[str, np.ndarray]) -> bytes:
    sizes = {"protocol_version": PROTOCOL, "little_endian": True}
    head = b"".join(pickle.dumps(value, 2) for value in (MAGIC, PROTOCOL, sizes))
    keys = b"\x80\x02](" + b"".join(map(text, storages)) + b"e."
    raw = b"".join(struct.pack("<q", len(values)) + values.astype("<f4").tobytes() for values in storages.values())
    return head + dictionary + keys + raw


STORAGES = {"1": np.arange(8.0), "2": np.array([7.0])}
GOOD = named(("w", tensor("1", 8, 2, (2, 3), (3, 1))), ("b", tensor("2", 1, 0, (1,), (1,))))


def test_a_checkpoint_gives_its_tensors():
    found = read_checkpoint(checkpoint(GOOD, STORAGES), "file")
    assert {name: values.tolist() for name, values in found.items()} == {
        "w": [[2.0, 3.0, 4.0], [5.0, 6.0, 7.0]],
        "b": [7.0],
    }


class Malicious:
    def __reduce__(self):
        return os.system, (f"touch {os.environ['INTERDRIVE_CACHE']}-was-here",)


@pytest.mark.parametrize("protocol", [0, 1, 2, 4, 5])
def test_a_checkpoint_that_wants_to_run_something_is_refused_and_nothing_is_run(cache, protocol):
    for place in range(4):
        parts = [pickle.dumps(value, 2) for value in (MAGIC, PROTOCOL, {"little_endian": True})] + [GOOD]
        parts[place] = pickle.dumps({"w": Malicious()} if place > 1 else Malicious(), protocol)
        with pytest.raises(InputError, match="file: ") as caught:
            read_checkpoint(b"".join(parts) + b"\x80\x02].", "file")
        assert "nothing of it was run" in str(caught.value)
    assert not Path(f"{cache}-was-here").exists()


@pytest.mark.parametrize(
    "dictionary",
    [
        b"\x80\x02cbuiltins\neval\n(" + text("1") + b"tR.",
        b"\x80\x02cos\nsystem\n(" + text("true") + b"o.",
        b"\x80\x02(S'true'\nios\nsystem\n.",
        b"\x80\x02ctorch\nFloatStorage\n(" + text("true") + b"tR.",
        b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n)\x81.",
        b"\x80\x02\x82\x01.",
    ],
)
def test_no_other_way_to_call_something_is_known(dictionary):
    with pytest.raises(InputError, match="nothing of it was run"):
        read_checkpoint(checkpoint(dictionary, {}), "file")


def test_every_truncation_of_a_checkpoint_is_refused():
    whole = checkpoint(GOOD, STORAGES)
    for length in range(len(whole)):
        with pytest.raises(InputError, match=r"^file: "):
            read_checkpoint(whole[:length], "file")


@pytest.mark.parametrize(
    ("dictionary", "storages", "words"),
    [
        (named(("w", tensor("1", 8, 4, (2, 3), (3, 1)))), STORAGES, "tensor w is not one piece"),
        (named(("w", tensor("1", 8, 0, (2, 3), (1, 2)))), STORAGES, "tensor w is not one piece"),
        (named(("w", tensor("1", 9, 0, (2, 3), (3, 1)))), STORAGES, "tensor w is not one piece"),
        (named(("w", tensor("3", 8, 0, (2, 3), (3, 1)))), STORAGES, "truncated, or no stream"),
        (named(("w", number(3))), STORAGES, "entry 'w' is no tensor"),
        (b"\x80\x02].", STORAGES, "truncated, or no stream"),
    ],
)
def test_pieces_that_do_not_fit_are_refused(dictionary, storages, words):
    with pytest.raises(InputError, match=words):
        read_checkpoint(checkpoint(dictionary, storages), "file")


def test_what_stands_behind_the_last_storage_is_refused():
    with pytest.raises(InputError, match="behind the last storage"):
        read_checkpoint(checkpoint(GOOD, STORAGES) + b"\0", "file")


# Installing: an invented model whose wheel holds the checkpoint above.


def wheel(path: Path, data: bytes, member: str = "net.tar") -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, data)
    return path


@pytest.fixture
def invented(monkeypatch) -> models.Model:
    data = checkpoint(GOOD, STORAGES)
    model = dataclasses.replace(
        models.WALENET,
        member="net.tar",
        member_sha256=models.hashlib.sha256(data).hexdigest(),
        sha256=digest(read_checkpoint(data, "")),
        shapes={"w": (2, 3), "b": (1,)},
    )
    monkeypatch.setitem(models.MODELS, "walenet", model)
    return model


def invoke(*arguments: str):
    return CliRunner().invoke(main, list(arguments))


def test_a_model_is_installed_from_a_wheel_once(invented, tmp_path, cache):
    assert "not installed: run 'interdrive models install walenet'" in " ".join(invoke("models").stdout.split())
    path = wheel(tmp_path / "a.whl", checkpoint(GOOD, STORAGES))
    result = invoke("models", "install", "walenet", "--from", str(path))
    assert (result.exit_code, "is installed: " in result.stdout) == (0, True)
    assert list((cache / "models").iterdir()) == [invented.path]
    assert invented.weights().metadata["source"] == "wale-net 3.0.3, net.tar"
    assert "installed, " in invoke("models", "list").stdout
    assert "already installed" in invoke("models", "install", "walenet").stdout
    assert invoke("models", "install", "walenet", "--from", "nothing.whl").exit_code == 2, "what is named is used"


def test_a_wheel_whose_contents_are_damaged_is_refused(invented, tmp_path):
    path = tmp_path / "a.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("net.tar", checkpoint(GOOD, STORAGES))
    data = bytearray(path.read_bytes())
    data[40] ^= 0xFF
    data[41] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.whl: not a wheel that can be read"):
        invented.install(path)


def test_a_damaged_installation_says_so_and_is_replaced(invented, tmp_path):
    path = wheel(tmp_path / "a.whl", checkpoint(GOOD, STORAGES))
    invented.install(path)
    invented.path.write_bytes(invented.path.read_bytes()[:-3])
    with pytest.raises(InputError, match=r"damaged .*; run 'interdrive models install walenet'"):
        invented.weights()
    invoke("models", "install", "walenet", "--from", str(path))
    assert invented.weights().tensors["b"].tolist() == [7.0]


def test_weights_that_are_not_installed_say_what_to_do():
    with pytest.raises(InputError) as caught:
        models.WALENET.weights()
    assert str(caught.value) == (
        "predictor walenet has no weights on this machine: run 'interdrive models install walenet'"
    )


@pytest.mark.parametrize(
    ("data", "member", "words"),
    [
        (checkpoint(GOOD, STORAGES)[:-1] + b"\1", "net.tar", "is not the published one"),
        (checkpoint(GOOD, STORAGES), "other.tar", "has no net.tar"),
    ],
)
def test_another_wheel_is_refused_and_nothing_is_written(invented, tmp_path, cache, data, member, words):
    path = wheel(tmp_path / "a.whl", data, member)
    result = invoke("models", "install", "walenet", "--from", str(path))
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert words in result.stderr
    assert "wanted is the wheel of wale-net 3.0.3" in result.stderr
    assert not cache.exists()


def test_a_file_that_is_no_wheel_is_refused(invented, tmp_path):
    path = tmp_path / "a.whl"
    path.write_bytes(b"PK no zip")
    with pytest.raises(InputError, match="not a wheel that can be read"):
        invented.install(path)
    with pytest.raises(InputError, match="no such file"):
        invented.install(tmp_path / "b.whl")


@pytest.mark.parametrize(
    ("complaint", "words"),
    [
        ("/bin/python: No module named pip", "this Python has no pip"),
        (
            "WARNING: Retrying\nNameResolutionError(...)\nERROR: No matching distribution",
            "no connection to the package index",
        ),
        ("ERROR: No matching distribution found", "(No matching distribution found)"),
    ],
)
def test_a_download_that_fails_says_why_and_what_to_do(monkeypatch, tmp_path, complaint, words):
    """The interpreter that runs pip is replaced by a script that fails as it does."""
    python = tmp_path / "python"
    python.write_text(f"#!{sys.executable}\nimport sys\nsys.exit({complaint!r})\n")
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    result = invoke("models", "install", "walenet")
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert words in result.stderr
    assert "run 'interdrive models install walenet --from WHEEL'" in result.stderr


def test_an_unknown_model_is_refused_with_the_nearest_name():
    assert "did you mean walenet?" in invoke("models", "install", "walnet").stderr


def test_a_stream_without_end_is_no_checkpoint():
    with pytest.raises(InputError):
        read_checkpoint(io.BytesIO(b"\x80\x02" + b"(" * 1000).getvalue(), "file")
