"""Runs commands of interdrive in a folder `small` that is a file system of its own, nearly full or read-only.

As a program it is a server in a mount namespace of its own. It has loaded what commands need, and every command gets a
process that is forked from it, which is what makes many of them quick.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Ended:
    """How a command ended, and a copy of the files that `small` held then."""

    returncode: int
    stdout: str
    stderr: str
    left: Path


class SmallDisk:
    """Commands run in `folder`; what lies in its `filled` is in `small` when each of them begins."""

    def __init__(self, folder: Path):
        self.folder, self.filled, self._server = folder, folder / "filled", None
        self.filled.mkdir()

    def run(self, room: int | str, *words: str, path: str = os.environ["PATH"]) -> Ended:
        """Runs a command with so many kilobytes left in `small`, or "ro": it is read-only."""
        if self._server is None:
            self._server = subprocess.Popen(
                ["unshare", "-rm", sys.executable, __file__],
                cwd=self.folder,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        print(json.dumps([room, words, path]), file=self._server.stdin, flush=True)
        left, returncode = json.loads(self._server.stdout.readline())
        texts = ((self.folder / name).read_text(encoding="utf-8") for name in ("stdout", "stderr"))
        return Ended(returncode, *texts, self.folder / left)

    def close(self) -> None:
        if self._server is not None:
            self._server.communicate()


def is_possible() -> bool:
    """This machine lets us make such a file system."""
    return subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode == 0


def _mount(room: int | str) -> None:
    small = Path("small")
    small.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=50m", "none", small], check=True)
    shutil.copytree("filled", small, dirs_exist_ok=True)
    found = os.statvfs(small)
    used = (found.f_blocks - found.f_bfree) * found.f_frsize // 1024
    limit = "ro" if room == "ro" else f"size={used + room}k"
    subprocess.run(["mount", "-o", f"remount,{limit}", small], check=True)


def _serve() -> None:
    import interdrive.plots
    import interdrive.report
    import interdrive.simulation
    import interdrive.studies  # noqa: F401
    from interdrive.cli import main

    for number, line in enumerate(sys.stdin):
        room, words, path = json.loads(line)
        _mount(room)
        child = os.fork()
        if child == 0:
            for name, descriptor in (("stdout", 1), ("stderr", 2)):
                os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
            os.environ["PATH"] = path
            main(words)  # exits
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        shutil.copytree("small", f"left-{number}")
        subprocess.run(["umount", "small"], check=True)
        print(json.dumps([f"left-{number}", code]), flush=True)  # noqa: T201


if __name__ == "__main__":
    _serve()
