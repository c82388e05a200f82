"""Environments of peers: one virtual environment each, from public packages, made once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

#: Where they are kept; nothing of them is part of this repository.
FOLDER = Path(os.environ.get("INTERDRIVE_PEERS", Path.home() / ".cache" / "interdrive" / "peers"))


def environment(name: str, requirements: list[str]) -> Path:
    """The Python of an environment with these packages; made where it is not there yet.

    Raises:
        SystemExit: A package cannot be installed; the text is pip's.
    """
    folder = FOLDER / name
    python, mark = folder / "bin" / "python", folder / "requirements.txt"
    wanted = "\n".join(requirements) + "\n"
    if mark.is_file() and mark.read_text() == wanted:
        return python
    sys.stderr.write(f"making {folder} (once, some minutes)\n")
    if not python.is_file():
        venv.create(folder, with_pip=True)
    partial = folder / "requirements.part"
    partial.write_text(wanted)
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r", str(partial)]
    if subprocess.run(command, check=False).returncode:
        raise SystemExit(f"{name}: pip could not install its packages (above); they need Python 3.11 and a network")
    partial.rename(mark)
    return python


def measured(command: list[str], timeout: float, folder: Path | None = None) -> dict[str, Any]:
    """What a script prints in its last line, as JSON; its other output goes to stderr.

    Raises:
        SystemExit: The script failed or took longer than `timeout` seconds.
    """
    try:
        done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        raise SystemExit(f"{command[1]}: not done after {timeout:.0f} s; ask for fewer steps") from None
    *others, last = done.stdout.strip().splitlines() or [""]
    sys.stderr.write("".join(f"{line}\n" for line in others[-3:] if done.returncode))
    if done.returncode:
        raise SystemExit(f"{command[1]}: ended with exit code {done.returncode}")
    found: dict[str, Any] = json.loads(last)
    return found
