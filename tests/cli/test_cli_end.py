"""How the command line ends when something happens that no command understands: one line and an exit code."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

#: The command line in a process in which something else has been prepared.
STARTED = "import os, signal, sys\nfrom interdrive.__main__ import start\n{prepared}\nstart()\n"

#: Makes `interdrive settings` do something else.
SETTINGS = """
import interdrive.config.schema
def broken(*_):
    {body}
interdrive.config.schema.SimulationSettings = broken
"""

#: Ctrl-C while a module is imported; Cython modules turn the exception into another one.
CTRL_C_IN_IMPORT = """
class Finder:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                raise ImportError("numpy.core.multiarray failed to import")
sys.meta_path.insert(0, Finder())
"""


def ended(prepared, *arguments, **environment):
    """Exit code, stdout and stderr of a command."""
    # An interrupt that a runner of tests has switched off would stay so.
    return subprocess.run(
        [sys.executable, "-c", STARTED.format(prepared=prepared), *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )


@pytest.mark.parametrize(
    ("body", "code", "words"),
    [
        ("raise ZeroDivisionError('1 / 0')", 70, "this is a bug, please report it: ZeroDivisionError: 1 / 0 ("),
        ("broken()", 70, "this is a bug, please report it: RecursionError: maximum recursion depth"),
        ("raise MemoryError", 71, "out of memory; a smaller scenario or fewer agents need less"),
        ("raise GeneratorExit", 70, "this is a bug, please report it: GeneratorExit ("),
        (r"raise ValueError('\x1b[2J\nand so on')", 70, r"ValueError: \x1b[2J and so on"),
    ],
)
def test_a_bug_is_one_line_with_an_exit_code_of_its_own(body, code, words):
    done = ended(SETTINGS.format(body=body), "settings")
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("error: ")
    assert words in done.stderr
    assert ("INTERDRIVE_TRACEBACK=1" in done.stderr) == (code == 70)


def test_the_traceback_of_a_bug_can_be_seen():
    done = ended(SETTINGS.format(body="raise ZeroDivisionError"), "settings", INTERDRIVE_TRACEBACK="1")
    assert done.returncode == 70
    assert done.stderr.startswith("Traceback (most recent call last):")
    assert done.stderr.splitlines()[-1].startswith("error: this is a bug, please report it: ZeroDivisionError")


def test_an_error_that_cannot_be_printed_is_one_line():
    unprintable = "class Mute(Exception):\n    def __str__(self):\n        raise RuntimeError\n"
    done = ended(unprintable + SETTINGS.format(body="raise Mute"), "settings")
    assert done.returncode == 70
    assert done.stderr.startswith("error: this is a bug, please report it: Mute (")


@pytest.mark.parametrize("module", ["interdrive.cli", "interdrive.cli.settings", "interdrive.config.schema"])
def test_ctrl_c_while_modules_are_imported_is_one_line(module):
    done = ended(CTRL_C_IN_IMPORT.format(module=module), "settings")
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr in ("interrupted\n", "interrupted, nothing written\n")


def test_a_working_folder_that_is_gone_is_one_line(tmp_path):
    prepared = f"os.mkdir({str(tmp_path / 'gone')!r}); os.chdir({str(tmp_path / 'gone')!r}); os.rmdir(os.getcwd())"
    done = ended(prepared, "settings")
    assert (done.returncode, done.stderr) == (2, "error: the working folder no longer exists; change to another one\n")


def test_closed_streams_are_no_failure():
    done = subprocess.run(f"{sys.executable} -m interdrive settings >&- 2>&-", shell=True, check=False)
    assert done.returncode == 0


def test_a_full_disk_behind_the_output_is_one_line():
    done = subprocess.run(
        f"{sys.executable} -m interdrive settings >/dev/full", shell=True, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (2, "error: No space left on device\n")


#: numpy 1.26 beside a pyarrow that was built for numpy 2.
PYARROW_TOO_NEW = """
class Finder:
    def find_spec(self, name, path, target=None):
        if name == "pyarrow":
            raise ImportError("pyarrow requires NumPy 2.0 or newer, found 1.26.4", name="pyarrow")
sys.meta_path.insert(0, Finder())
import interdrive.simulation
interdrive.simulation.simulate = lambda *_, **__: print("simulated in vain")
"""


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "t_junction", "--out", "made"],
        ["batch", "t_junction", "--out", "made", "--workers", "1"],
        ["study", "merge", "--out", "made"],
        ["predict-eval", "t_junction", "--out", "made"],
        ["criticality", "t_junction", "--out", "made"],
    ],
)
def test_a_pyarrow_that_does_not_work_is_found_out_before_anything_is_simulated(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    done = ended(PYARROW_TOO_NEW, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1, done.stderr
    assert "pyarrow requires NumPy 2.0 or newer, found 1.26.4" in done.stderr
    assert list(tmp_path.iterdir()) == []
