"""Planners and predictors from outside, by name: `module:object` or an installed entry point."""

from __future__ import annotations

import copy
import difflib
import importlib
import importlib.metadata
from typing import Any

from interdrive.errors import InputError


def find(name: str, native: tuple[str, ...], what: str) -> Any:  # noqa: ANN401 - whatever the user wrote
    """The object behind a name: `module:object`, or an entry point of the group `interdrive.<what>s`.

    Args:
        name: As given by the user.
        native: Names of the native ones, for the suggestion.
        what: "planner" or "predictor".

    Raises:
        InputError: The name is unknown, the module does not import, or it has no such object.
    """
    if ":" in name:
        module_name, _, attribute = name.partition(":")
        try:
            found: Any = importlib.import_module(module_name)
        except Exception as error:
            raise InputError(f"{what} {name}: module {module_name} does not import ({error})") from error
        for part in attribute.split("."):
            if not hasattr(found, part):
                raise InputError(f"{what} {name}: module {module_name} has no {attribute}")
            found = getattr(found, part)
        return found
    entry_points = importlib.metadata.entry_points(group=f"interdrive.{what}s")
    if name in entry_points.names:
        try:
            return entry_points[name].load()
        except Exception as error:
            raise InputError(f"{what} {name}: its entry point does not load ({error})") from error
    names = sorted({*native, *entry_points.names})
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}, or module:object"
    raise InputError(f"unknown {what} {name!r}: {hint}")


def made(choice: Any, method: str, what: str) -> Any:  # noqa: ANN401 - whatever the user wrote
    """An object of its own for one agent and one run: a class or factory is called, an object is copied.

    Args:
        choice: A class, a factory without arguments, or an object.
        method: The method that it must have: "plan" or "predict".
        what: "planner" or "predictor".

    Raises:
        InputError: It cannot be made or copied, or has no such method.
    """
    is_object = hasattr(choice, method) and not isinstance(choice, type)
    try:
        found = copy.deepcopy(choice) if is_object else choice() if callable(choice) else choice
    except Exception as error:
        raise InputError(f"{what} {choice!r} cannot be made ({type(error).__name__}: {error})") from error
    return found
