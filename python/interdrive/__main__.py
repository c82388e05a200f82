"""Where the command line starts: `interdrive` and `python -m interdrive`.

Every failure that is not a refused input ends here, in one line. As little as possible is imported before this is set
up.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys

TYPE_CHECKING = False  # typing takes longer to import than everything else here
if TYPE_CHECKING:
    from types import FrameType
    from typing import NoReturn

#: Exit codes: something cannot be used; interrupted; a bug (EX_SOFTWARE of sysexits.h); out of memory (EX_OSERR).
REFUSED, INTERRUPTED, BUG, OUT_OF_MEMORY = 2, 130, 70, 71
#: If this environment variable is set, the traceback of a bug is printed.
TRACEBACK = "INTERDRIVE_TRACEBACK"


def start() -> NoReturn:
    """Runs the command line and exits; `interdrive.cli` lists the exit codes."""
    signal.signal(signal.SIGINT, _leave)
    _open_streams()
    # Figures are written to files, without dates, whatever the environment says; matplotlib fails with values that it
    # does not know.
    os.environ["MPLBACKEND"] = "agg"
    os.environ.pop("SOURCE_DATE_EPOCH", None)
    # Threads of numpy's BLAS wait busily, and how they share a product decides its last bits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    code: int | str | None = 0
    try:
        from interdrive.cli import main  # noqa: PLC0415 - Ctrl-C is one line from here on

        signal.signal(signal.SIGINT, _interrupt)
        main(prog_name="interdrive")
    except SystemExit as end:
        code = end.code
    except BaseException as error:  # noqa: BLE001 - never a bare traceback
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        code = last_resort(error)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # all output is complete
    _close_output()
    if code == INTERRUPTED:
        # If exec was interrupted, the interpreter would otherwise end with the signal.
        atexit._run_exitfuncs()
        os._exit(INTERRUPTED)
    sys.exit(code)


def _open_streams() -> None:
    """Makes streams accept file names that are not text, and replaces closed streams."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115 - until the end
        else:
            stream.reconfigure(errors="backslashreplace")


def _close_output() -> None:
    """Closes the streams; otherwise the interpreter would report failed writes once more."""
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        try:
            stream.flush()
        except (OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)


def last_resort(error: BaseException) -> int:
    """Prints one line on stderr for an unexpected exception, and returns the exit code.

    Args:
        error: The exception.
    """
    if _Interrupts.came or isinstance(error, KeyboardInterrupt):
        return _say("interrupted", INTERRUPTED)
    if isinstance(error, MemoryError):
        return _say("error: out of memory; a smaller scenario or fewer agents need less", OUT_OF_MEMORY)
    if isinstance(error, ImportError) and not str(error.name).startswith("interdrive"):
        return _say(
            f"error: the installation does not work: {_described(error)}; "
            "`pip install --upgrade interdrive` installs compatible versions",
            REFUSED,
        )
    where = _place(error)
    wanted = os.environ.get(TRACEBACK, "") not in ("", "0")
    if wanted:
        _print_traceback(error)
    hint = "" if wanted else f"; set {TRACEBACK}=1 to see the traceback"
    return _say(f"error: this is a bug, please report it: {_described(error)}{where}{hint}", BUG)


class _Interrupts:
    """Records whether Ctrl-C was pressed: libraries turn the exception into others while they are imported."""

    came = False


def _leave(_number: int, _frame: FrameType | None) -> None:
    """Ends at once: nothing has begun, and libraries might swallow an exception."""
    os.write(2, b"interrupted, nothing written\n")
    os._exit(INTERRUPTED)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _Interrupts.came = True
    signal.default_int_handler(number, frame)


def _described(error: BaseException) -> str:
    """Type and text of an exception; its `__str__` may fail."""
    try:
        text = " ".join(str(error).split())[:200]
    except Exception:  # noqa: BLE001 - whatever it does
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _place(error: BaseException) -> str:
    """The innermost line of interdrive in the traceback."""
    place, trace = "", error.__traceback__
    while trace is not None:
        name = str(trace.tb_frame.f_globals.get("__name__", ""))
        if name.partition(".")[0] == "interdrive":
            place = f" ({name}, line {trace.tb_lineno})"
        trace = trace.tb_next
    return place


def _print_traceback(error: BaseException) -> None:
    import traceback  # noqa: PLC0415 - only then

    try:
        lines = traceback.format_exception(error)
    except Exception:  # noqa: BLE001 - an exception that cannot be printed is one line all the same
        lines = traceback.format_tb(error.__traceback__)
    _write("".join(lines))


def _say(line: str, code: int) -> int:
    """Prints a line if possible."""
    _write(f"{' '.join(line.splitlines())}\n")
    return code


def _write(text: str) -> None:
    """Prints on stderr if possible; what a terminal would obey is shown, as by `interdrive.cli.terminal`."""
    try:
        sys.stderr.write("".join(sign if sign.isprintable() or sign == "\n" else ascii(sign)[1:-1] for sign in text))
        sys.stderr.flush()
    except (OSError, ValueError, MemoryError):
        pass


if __name__ == "__main__":
    start()
