"""Starts SUMO in a process of its own, on a private copy of its files, and asks it."""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.errors import InputError, InterdriveError, MissingExtraError

if TYPE_CHECKING:
    from interdrive.scenario import SumoTraffic

#: Time that SUMO has to end by itself [s].
_ENDING_S = 5.0
#: Letters of what SUMO said last.
_LONGEST = 300


class SumoError(InterdriveError):
    """SUMO ended before the run; the text names the time step and what it said last."""

    exit_code = 1


def installed_version() -> str:
    """Version of the installed libsumo.

    Raises:
        MissingExtraError: It is not installed.
    """
    if importlib.util.find_spec("libsumo") is None:
        raise MissingExtraError("SUMO scenarios need the extra: pip install 'interdrive[sumo]'")
    return importlib.metadata.version("libsumo")


class Process:
    """A simulation of SUMO, at its first time step."""

    def __init__(self, sumo: SumoTraffic, dt: float, seed: int, prefix: str) -> None:
        """Starts it, and simulates what comes before the first time step.

        Args:
            sumo: What it simulates.
            dt: Time between steps [s].
            seed: Seed of the run.
            prefix: Of the names of agents in SUMO; it is made longer until no file has it.

        Raises:
            MissingExtraError: SUMO is not installed.
            InputError: It refuses its files, and says why.
            SumoError: It does not start.
        """
        self.version, self._config = installed_version(), sumo.config
        folder = tempfile.mkdtemp(prefix="interdrive-sumo-")
        for name, content in sumo.files:
            path = Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        self._said = Path(folder) / "said.txt"
        with self._said.open("wb") as said:
            self._child = subprocess.Popen(
                [sys.executable, "-m", "interdrive.sumo.child"],
                cwd=folder,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=said,
                text=True,
                encoding="utf-8",
                start_new_session=True,  # Ctrl-C is for the run, which ends it
            )
        self._close = weakref.finalize(self, _end, self._child, folder)
        options = _options(sumo, dt, seed)
        self._silence = 0
        self.first = self._ask(
            {
                "options": options,
                "delta_steps": sumo.delta_steps,
                "before": sumo.presimulation_steps,
                "prefix": _own(prefix, sumo),
            },
            None,
        )
        self._silence = self._said.stat().st_size  # what it says of its libraries is not why it ends

    def step(self, request: dict[str, Any], time_step: int) -> dict[str, Any]:
        """One time step, see `interdrive.sumo.child`.

        Raises:
            SumoError: It has ended.
        """
        return self._ask(request, time_step)

    def close(self) -> None:
        """Ends it."""
        self._close()

    def _ask(self, request: dict[str, Any], time_step: int | None) -> dict[str, Any]:
        assert self._child.stdin is not None and self._child.stdout is not None
        try:
            self._child.stdin.write(json.dumps(request) + "\n")
            self._child.stdin.flush()
            line = self._child.stdout.readline()
        except OSError:
            line = ""
        answer: dict[str, Any] = json.loads(line) if line.endswith("\n") else {"error": ""}
        if "error" in answer:
            said = answer["error"] or self._last_line()
            self.close()
            if time_step is None and answer["error"]:
                raise InputError(f"{self._config}: SUMO refuses it: {said}")
            when = "its start" if time_step is None else f"time step {time_step}"
            raise SumoError(f"SUMO ended at {when}: {said}")
        return answer

    def _last_line(self) -> str:
        """What it printed last, if it has."""
        self._child.wait(_ENDING_S)
        lines = self._said.read_bytes()[self._silence :].decode("utf-8", "replace").split("\n")
        said = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
        return f"{said[:_LONGEST]} (exit code {self._child.returncode})"


def _end(child: subprocess.Popen[str], folder: str) -> None:
    for pipe in (child.stdin, child.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):  # what was not written is lost with the process
                pipe.close()
    try:
        child.wait(_ENDING_S)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
    shutil.rmtree(folder, ignore_errors=True)


def _own(prefix: str, sumo: SumoTraffic) -> str:
    while any(prefix.encode() in content for _, content in sumo.files):
        prefix += "_"
    return prefix


def _options(sumo: SumoTraffic, dt: float, seed: int) -> list[str]:
    options = {
        "configuration-file": sumo.config,
        "seed": str((sumo.seed + seed) % 2**31),
        "step-length": f"{dt / sumo.delta_steps:g}",
        "time-to-teleport": "-1",
        "collision.action": "none",
        "ignore-junction-blocker": "10",
        "no-warnings": "true",
        "no-step-log": "true",
    }
    if sumo.lateral_resolution > 0.0:  # SUMO refuses both a resolution and a duration of lane changes
        options |= {"lateral-resolution": f"{sumo.lateral_resolution:g}", "lanechange.duration": "0"}
    return [text for name, value in options.items() for text in (f"--{name}", value)]
