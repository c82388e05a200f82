"""Weights: safetensors files, and how published weights get into the cache without being unpickled."""

from __future__ import annotations

import hashlib
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from safetensors.numpy import save_file

from interdrive.cli import main
from interdrive.errors import InputError
from interdrive.predictors import models
from interdrive.storage.weights import digest, read_weights

TENSORS = {"a.weight": np.arange(6, dtype=np.float32).reshape(2, 3), "a.bias": np.array([0.5, -1.0], np.float32)}


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("INTERDRIVE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "net.safetensors"
    save_file(TENSORS, path, {"made by": "a test"})
    return path


def test_weights_come_back_as_they_were_written(file):
    found = read_weights(file)
    assert found.metadata == {"made by": "a test"}
    assert {name: values.tolist() for name, values in found.tensors.items()} == {
        name: values.tolist() for name, values in TENSORS.items()
    }
    assert not any(values.flags.writeable for values in found.tensors.values())


@pytest.mark.parametrize("length", [0, 5, 60, -1])
def test_a_truncated_file_is_refused_by_its_name(file, length):
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(InputError, match=r"weights .*net\.safetensors: damaged"):
        read_weights(file)


@pytest.mark.parametrize(
    ("bias", "words"),
    [
        (np.array([0.0, np.nan], np.float32), "a.bias has values that are not finite"),
        (np.array([0.0, 1.0]), "a.bias has type float64, float32 is expected"),
    ],
)
def test_numbers_that_no_network_can_have_are_refused(file, bias, words):
    save_file({**TENSORS, "a.bias": bias}, file)
    with pytest.raises(InputError, match=words):
        read_weights(file)


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
    assert models.cache_folder() == Path("/somewhere")
    monkeypatch.delenv("INTERDRIVE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/caches")
    assert models.cache_folder() == Path("/caches/interdrive")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/user")
    assert models.cache_folder() == Path("/home/user/.cache/interdrive")


# Installing: an invented checkpoint, whose numbers begin where those of the published one do.

NUMBERS = np.arange(8, dtype="<f4")
DATA = bytes(models._NUMBERS_FROM) + NUMBERS.tobytes()


def wheel(path: Path, data: bytes = DATA, member: str = models.MEMBER) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(member, data)
    return path


@pytest.fixture
def invented(monkeypatch):
    monkeypatch.setattr(models, "SHA256", hashlib.sha256(DATA).hexdigest())


def invoke(*arguments: str):
    return CliRunner().invoke(main, ["models", *arguments])


def test_a_model_is_installed_from_a_wheel_once(invented, tmp_path, cache):
    assert "not installed: run 'interdrive models install walenet'" in " ".join(invoke().stdout.split())
    result = invoke("install", "walenet", "--from", str(wheel(tmp_path / "a.whl")))
    assert (result.exit_code, "is installed: " in result.stdout) == (0, True)
    assert list((cache / "models").iterdir()) == [models.weights_file()]
    assert models.weights().tolist() == NUMBERS.tolist()
    assert "installed, " in invoke("list").stdout
    assert "already installed" in invoke("install", "walenet").stdout
    assert invoke("install", "walenet", "--from", "nothing.whl").exit_code == 2, "what is named is used"


def test_a_wheel_whose_contents_are_damaged_is_refused(invented, tmp_path):
    path = wheel(tmp_path / "a.whl")
    data = bytearray(path.read_bytes())
    start = 30 + len(models.MEMBER)
    data[start : start + 2] = bytes(byte ^ 0xFF for byte in data[start : start + 2])
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.whl: not a wheel that can be read"):
        models.install(path)


def test_a_damaged_installation_says_so_and_is_replaced(invented, tmp_path):
    path = wheel(tmp_path / "a.whl")
    models.install(path)
    models.weights_file().write_bytes(DATA[:-3])
    with pytest.raises(InputError, match=r"damaged; run 'interdrive models install walenet'"):
        models.weights()
    invoke("install", "walenet", "--from", str(path))
    assert models.weights().tolist() == NUMBERS.tolist()


def test_weights_that_are_not_installed_say_what_to_do():
    with pytest.raises(InputError) as caught:
        models.weights()
    assert str(caught.value) == (
        "the weights of walenet are not on this machine: run 'interdrive models install walenet'"
    )


@pytest.mark.parametrize(
    ("data", "member", "words"),
    [(DATA[:-1] + b"\1", models.MEMBER, "is not the published one"), (DATA, "other.tar", f"has no {models.MEMBER}")],
)
def test_another_wheel_is_refused_and_nothing_is_written(invented, tmp_path, cache, data, member, words):
    result = invoke("install", "walenet", "--from", str(wheel(tmp_path / "a.whl", data, member)))
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert words in result.stderr
    assert "give the wheel of wale-net 3.0.3" in result.stderr
    assert not cache.exists()


def test_a_cache_that_cannot_be_written_is_named(invented, tmp_path, cache):
    cache.write_text("a file, no folder")
    with pytest.raises(InputError, match=r"weights .*cache.*: cannot be written"):
        models.install(wheel(tmp_path / "a.whl"))


def test_a_file_that_is_no_wheel_is_refused(tmp_path):
    path = tmp_path / "a.whl"
    path.write_bytes(b"PK no zip")
    with pytest.raises(InputError, match="not a wheel that can be read"):
        models.install(path)
    with pytest.raises(InputError, match="no such file"):
        models.install(tmp_path / "b.whl")


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
    result = invoke("install", "walenet")
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert words in result.stderr
    assert "run 'interdrive models install walenet --from WHEEL'" in result.stderr


def test_an_unknown_model_is_refused_with_the_names_of_those_there_are():
    result = invoke("install", "walnet")
    assert (result.exit_code, "'walenet'" in result.stderr) == (2, True)
