"""A trial in a process of its own, with limits of time and memory; what became of it when it did not end by itself."""

from __future__ import annotations

import json
import os
import resource
import select
import shutil
import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tests.fuzz.trial import FAILED, tried, tried_source

if TYPE_CHECKING:
    from random import Random


@dataclass(frozen=True)
class Limits:
    """What a trial may use; time is that of the processor, because machines are shared.

    Attributes:
        cpu_seconds: Of one trial.
        wall_seconds: A trial that waits for something for so long hangs.
        memory: Resident memory [bytes].
    """

    cpu_seconds: int = 20
    wall_seconds: float = 200.0
    memory: int = 2 * 10**9


@dataclass(frozen=True)
class Ending:
    """How a trial ended.

    Attributes:
        verdict: "accepted", "refused" or "failed".
        stage: Where it ended.
        text: The refusal, or what failed.
        cpu_seconds: Time that it took on the processor.
        memory: Largest resident memory [bytes].
    """

    verdict: str
    stage: str
    text: str
    cpu_seconds: float
    memory: int


def isolated(
    files: dict[str, bytes], main: str, random: Random, limits: Limits, options: dict[str, str] | None = None
) -> Ending:
    """Tries a file in a child process, which is made by forking.

    Threads do not survive that: those of the core live no longer than a simulation, Arrow starts its own anew.

    Args:
        files: Content by file name.
        main: The one that is opened.
        random: For the choices of the trial.
        limits: Of the child.
        options: Of a source of another tool; None: it is a CommonRoad file.

    Returns:
        The ending; a child that was killed or used too much has failed.
    """
    memory = Path("/dev/shm")  # where waiting for a disk takes no time
    folder = Path(tempfile.mkdtemp(prefix="interdrive-fuzz-", dir=memory if memory.is_dir() else None))
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _child(files, main, folder, random, limits, writer, options)
    os.close(writer)
    try:
        lines, timed_out = _heard(reader, child, limits.wall_seconds)
        _pid, status, usage = os.wait4(child, 0)
    finally:
        os.close(reader)
        shutil.rmtree(folder, ignore_errors=True)
    memory, seconds = usage.ru_maxrss * 1024, usage.ru_utime + usage.ru_stime
    stages = [line["stage"] for line in lines if "stage" in line]
    stage = stages[-1] if stages else "start"
    endings = [line for line in lines if "verdict" in line]
    if timed_out:
        return Ending(FAILED, stage, f"hangs: not ended after {limits.wall_seconds:g} s", seconds, memory)
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        what = f"takes more than {limits.cpu_seconds} s" if seconds >= limits.cpu_seconds else f"killed by {name}"
        return Ending(FAILED, stage, what, seconds, memory)
    if not endings:
        return Ending(FAILED, stage, "the process ended without a verdict", seconds, memory)
    if memory > limits.memory:
        return Ending(FAILED, stage, f"takes {memory / 1e9:.1f} GB", seconds, memory)
    return Ending(endings[-1]["verdict"], stage, endings[-1]["text"], seconds, memory)


def _child(
    files: dict[str, bytes],
    main: str,
    folder: Path,
    random: Random,
    limits: Limits,
    writer: int,
    options: dict[str, str] | None,
) -> None:
    """The whole life of the child."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (limits.cpu_seconds, limits.cpu_seconds + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (limits.memory * 4, limits.memory * 4))
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)

    def say(**line: str) -> None:
        os.write(writer, (json.dumps(line) + "\n").encode())

    try:
        inputs, out = folder / "in", folder / "out"
        for made in (inputs, out):
            made.mkdir()
        for name, data in files.items():
            (inputs / name).write_bytes(data)
        if options is None:
            os.chdir(out)
            verdict, text = tried(inputs / main, out, random, lambda stage: say(stage=stage))
        else:
            os.chdir(inputs)
            verdict, text = tried_source(inputs / main, out, random, options, lambda stage: say(stage=stage))
        say(verdict=verdict, text=text[-6000:])
    finally:
        os._exit(0)


def _heard(reader: int, child: int, seconds: float) -> tuple[list[dict[str, str]], bool]:
    """What the child said until it closed its end, and whether it was killed because it did not."""
    until = time.monotonic() + seconds
    heard = b""
    while (left := until - time.monotonic()) > 0:
        if select.select([reader], [], [], left)[0]:
            data = os.read(reader, 65_536)
            if not data:
                return _lines(heard), False
            heard += data
    os.killpg(child, signal.SIGKILL)
    return _lines(heard), True


def _lines(heard: bytes) -> list[dict[str, str]]:
    return [json.loads(line) for line in heard.splitlines() if line.endswith(b"}")]
