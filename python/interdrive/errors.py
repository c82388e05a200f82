"""Every exception that interdrive raises on purpose; all descend from `InterdriveError`."""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes longer to import than this module
if TYPE_CHECKING:
    from typing import Self


class InterdriveError(Exception):
    """Any error that interdrive reports on purpose.

    The last argument is the message, those before it are the location, the outermost first:
    `InputError("agent 5", "view.sensor_radius", "must be positive, not -1")`.
    """

    #: Exit code of a command that it ends.
    exit_code = 2

    @property
    def location(self) -> str:
        """File, agent, setting or option; "" if it is part of the message."""
        return ": ".join(self.args[:-1])

    @property
    def message(self) -> str:
        """The message without the location."""
        return str(self.args[-1]) if self.args else ""

    def __str__(self) -> str:
        """Location and message on one line."""
        return ": ".join(map(str, self.args))

    def within(self, *location: str) -> Self:
        """The same error with a location around its own."""
        return type(self)(*location, *self.args)


class InputError(InterdriveError):
    """Input that cannot be used: where it is, what is wrong with it, and what to do."""


def check_between(name: str, value: float, low: float, high: float) -> None:
    """Raises InputError unless a value is at least `low` and at most `high`."""
    if not low <= value <= high:
        raise InputError(name, f"must be at least {low} and at most {high}, not {value}")


class NoRouteError(InputError):
    """The road network does not connect an agent's start with its goal."""


class StepOrderError(InterdriveError):
    """Scene, predictions or plans belong to another time step than the world's."""


class PredictorError(InterdriveError):
    """A predictor raised an exception or returned invalid predictions; the text names the time step."""


class ResultsError(InterdriveError):
    """A run folder cannot be written or read; the text names the path."""


class MissingExtraError(InterdriveError):
    """An optional dependency is not installed; the text says what to install."""
