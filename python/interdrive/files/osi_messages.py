"""Messages of the Open Simulation Interface, of the extra `osi`; loaded on first use."""

from __future__ import annotations

from typing import Any

from interdrive.errors import InputError

_ADVICE = "OSI files need the extra: pip install 'interdrive[osi]'"


def betterosi() -> Any:  # noqa: ANN401 - it has no types
    """The package with the classes of messages.

    Raises:
        InputError: It is not installed; the line says how to.
    """
    try:
        import betterosi as found  # noqa: PLC0415
    except ImportError as error:
        raise InputError(_ADVICE) from error
    return found


def mcap_reader() -> Any:  # noqa: ANN401 - it has no types
    """The function that opens MCAP.

    Raises:
        InputError: It is not installed; the line says how to.
    """
    try:
        from mcap.reader import make_reader  # noqa: PLC0415
    except ImportError as error:
        raise InputError(_ADVICE) from error
    return make_reader
