"""Planners and predictors by name (built-in, `module:object` or entry point), with settings."""

from __future__ import annotations

import ast
import copy
import difflib
import importlib
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.config.binding import bind, constructed, description, dotted
from interdrive.errors import InputError, InterdriveError, MissingExtraError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

#: The planner of agents for which none is chosen.
DEFAULT_PLANNER = "rollout"


@dataclass(frozen=True)
class Choice:
    """A planner or predictor with its settings.

    Attributes:
        chosen: Name, `module:object`, record, object, class or factory; None: the planner or predictor of all other
            agents.
        settings: Its settings by their dotted names, as text or plain values; those of the view begin with "view.".
    """

    chosen: object
    settings: Mapping[str, object] = field(default_factory=dict)


def read_choice(given: object, what: str) -> Choice:
    """Reads a choice from any of its notations.

    Args:
        given: A text `PLANNER[,NAME=VALUE...]` (commas in brackets do not separate), a table with the key `what` and
            settings (as TOML and run.json have it), or anything else that can be chosen, without settings.
        what: "planner" or "predictor".

    Raises:
        InputError: The text does not have this syntax.
    """
    if isinstance(given, Choice):
        return given
    if isinstance(given, str):
        return _spelled(given, what)
    if isinstance(given, Mapping):
        table = dotted(given)
        chosen = table.pop(what, None)
        inner = read_choice(chosen, what) if isinstance(chosen, str) else Choice(chosen)
        return Choice(inner.chosen, {**inner.settings, **table})
    return Choice(given)


def _spelled(text: str, what: str) -> Choice:
    form = f"write {what.upper()}[,NAME=VALUE...]"
    parts = [part.strip() for part in re.split(r",(?![^\[]*\])", text)]
    chosen = parts.pop(0) if "=" not in parts[0] else None
    settings: dict[str, object] = {}
    for part in parts:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not name:
            raise InputError(f"{what} {text!r}", f"{part or 'nothing'} after a comma; {form}")
        if name in settings:
            raise InputError(f"{what} {text!r}", f"{name} is given twice")
        settings[name] = value
    if chosen == "":
        raise InputError(f"{what} {text!r}", f"the name is missing; {form}")
    return Choice(chosen and _importable(chosen), settings)


def _importable(name: str) -> str:
    """`module:object` for an object in a file below the working folder, such as `my/planner.py:Mine`."""
    file, colon, attribute = name.partition(":")
    if not colon or not file.endswith(".py") or Path(file).is_absolute():
        return name
    return f"{file.removeprefix('./').removesuffix('.py').replace('/', '.')}:{attribute}"


def find(name: str, native: tuple[str, ...], what: str) -> Any:  # noqa: ANN401 - whatever the user wrote
    """The object behind a name: `module:object`, or an entry point of the group `interdrive.<what>s`.

    Args:
        name: As given by the user.
        native: Names of native planners or predictors, for the suggestion.
        what: "planner" or "predictor".

    Raises:
        MissingExtraError: A requirement is not installed.
        InputError: The name is unknown, the module cannot be imported, or it has no such object.
    """
    if ":" in name:
        module_name, _, attribute = name.partition(":")
        try:
            found: Any = importlib.import_module(module_name)
        except (InterdriveError, KeyboardInterrupt):
            raise
        except BaseException as error:
            raise InputError(f"{what} {name}", f"module {module_name} cannot be imported ({_why(error)})") from error
        for part in attribute.split("."):
            if not hasattr(found, part):
                raise InputError(f"{what} {name}", f"module {module_name} has no {attribute}")
            found = getattr(found, part)
        return found
    offered = [entry_point for entry_point in _entry_points(what) if entry_point.name == name]
    if len(offered) > 1:
        sources = " and ".join(_source(entry_point) for entry_point in offered)
        raise InputError(f"{what} {name} is offered by {sources}: write it as {offered[0].value} or {offered[1].value}")
    if offered:
        return _loaded(offered[0], what)
    if hint := _in_own_file(name, what):
        raise InputError(f"unknown {what} {name!r}", hint)
    names = sorted({*native, *(entry_point.name for entry_point in _entry_points(what))})
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}, or module:object"
    raise InputError(f"unknown {what} {name!r}", hint)


def _in_own_file(name: str, what: str) -> str:
    """How to name a class in a Python file of the working folder, if the name is that of such a file; else ""."""
    module = name.removeprefix("./").removesuffix(".py")
    file = Path(f"{module}.py")
    if not module or file.is_absolute() or not file.is_file():
        return ""
    method = {"planner": "plan", "predictor": "predict"}[what]
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        tree = ast.Module([], [])
    classes = [
        node.name
        for node in tree.body
        if isinstance(node, ast.ClassDef) and any(getattr(item, "name", "") == method for item in node.body)
    ]
    prefix = module.replace("/", ".")
    return f"did you mean {prefix}:{classes[0]}?" if classes else f"write it as {prefix}:CLASS"


def _why(error: BaseException) -> str:
    """The text of an exception that is clear without its type, such as that of a failed import."""
    from interdrive.foreign import text_of  # noqa: PLC0415 - numpy, which the help of the command line does not need

    return text_of(error) if isinstance(error, ImportError) else _failure(error)


def versions(name: str, what: str) -> dict[str, str]:
    """Versions of the distributions that a planner or predictor consists of, by name, without interdrive itself.

    For an entry point these are the distribution that offers it and the ones of its extra, for `module:object` all that
    contain the module. Native plug-ins and modules in a plain folder have none.

    Args:
        name: As given by the user.
        what: "planner" or "predictor".
    """
    import importlib.metadata  # noqa: PLC0415 - takes longer than all other imports here

    if ":" in name:
        package = name.partition(":")[0].partition(".")[0]
        distributions = importlib.metadata.packages_distributions().get(package, [])
    else:
        offered = [entry_point for entry_point in _entry_points(what) if entry_point.name == name and entry_point.dist]
        distributions = [e.dist.name for e in offered if e.dist is not None]
        distributions += [each for entry_point in offered for each in _extra(entry_point)]
    return _versions(sorted({each for each in distributions if each != "interdrive"}))


@dataclass(frozen=True)
class Listed:
    """A planner or predictor that can be chosen by name.

    Attributes:
        name: Its name.
        source: "built-in", or the distribution that offers it, with its version.
        text: One line of description, or the reason why it cannot be used.
        is_usable: Whether it can be used in this environment.
    """

    name: str
    source: str
    text: str
    is_usable: bool = True


def listed(native: Mapping[str, str], what: str) -> list[Listed]:
    """Native planners or predictors first, then those of installed distributions, by name.

    Args:
        native: Name -> one line of description.
        what: "planner" or "predictor".
    """
    found = [Listed(name, "built-in", text) for name, text in native.items()]
    for entry_point in _entry_points(what):
        lacking = _missing_extra(entry_point)
        try:
            text = description(_loaded(entry_point, what)).partition("\n")[0]
        except InterdriveError as error:
            text, lacking = "", lacking or str(error)
        if entry_point.name in native:
            lacking = f"hidden by the built-in {what} of that name, write it as {entry_point.value}"
        text = f"{text} ({lacking})" if text and lacking else text or lacking
        found.append(Listed(entry_point.name, _source(entry_point), text, not lacking))
    return found


def _entry_points(what: str) -> list[EntryPoint]:
    """Entry points of installed distributions, by name and source, without duplicates on the path."""
    import importlib.metadata  # noqa: PLC0415 - takes longer than all other imports here

    found = {(e.name, _source(e), e.value): e for e in importlib.metadata.entry_points(group=f"interdrive.{what}s")}
    return [found[key] for key in sorted(found)]


def _source(entry_point: EntryPoint) -> str:
    return f"{entry_point.dist.name} {entry_point.dist.version}" if entry_point.dist else "an unknown distribution"


def _loaded(entry_point: EntryPoint, what: str) -> Any:  # noqa: ANN401 - whatever was registered
    name = entry_point.name
    try:
        return entry_point.load()
    except (InterdriveError, KeyboardInterrupt):
        raise
    except BaseException as error:
        lacking = _missing_extra(entry_point)
        if lacking and isinstance(error, ImportError):
            raise MissingExtraError(f"{what} {name} {lacking}") from error
        raise InputError(f"{what} {name}", f"its entry point cannot be loaded ({_failure(error)})") from error


def _missing_extra(entry_point: EntryPoint) -> str:
    """What to install, if the distribution has an extra of the same name that is not installed; else ""."""
    if entry_point.dist is not None and not all(_versions(_extra(entry_point)).values()):
        return f"needs the extra: pip install {entry_point.dist.name}[{entry_point.name}]"
    return ""


def _extra(entry_point: EntryPoint) -> list[str]:
    """Distributions required by the extra of the same name; none if there is no such extra."""
    name, distribution = entry_point.name, entry_point.dist
    if distribution is None or name not in (distribution.metadata.get_all("Provides-Extra") or ()):
        return []
    marked = re.compile(rf"extra\s*==\s*['\"]{re.escape(name)}['\"]")
    needed = [requirement.partition(";") for requirement in distribution.requires or ()]
    texts = [package.strip() for package, _, marker in needed if marked.search(marker)]
    return [re.split(r"[^\w.-]", text, maxsplit=1)[0] for text in texts]


def _versions(distributions: Iterable[str]) -> dict[str, str]:
    """Their versions; "" for distributions that are not installed."""
    import importlib.metadata  # noqa: PLC0415 - takes longer than all other imports here

    found = dict.fromkeys(distributions, "")
    for distribution in found:
        with suppress(importlib.metadata.PackageNotFoundError):
            found[distribution] = importlib.metadata.version(distribution)
    return found


def made(source: Any, method: str, name: str, settings: Mapping[str, object]) -> Any:  # noqa: ANN401
    """Makes a separate object for one agent and one run: calls a class or factory, copies an object.

    Args:
        source: A class, a factory without arguments, or an object.
        method: The required method: "plan" or "predict".
        name: For messages, such as "planner mine:Follow".
        settings: Values of its fields by dotted names; they require a dataclass.

    Raises:
        InputError: The object cannot be made or copied, or the settings do not fit.
    """
    is_object = hasattr(source, method) and not isinstance(source, type)
    try:
        if is_object or not callable(source):
            found = copy.deepcopy(source)
        elif isinstance(source, type) and is_dataclass(source):
            return constructed(source, settings)
        else:
            found = source()
        if not settings:
            return found
        if is_dataclass(found) and not isinstance(found, type):
            return bind(found, settings)
    except InputError as error:
        raise error.within(name) from error
    except (InterdriveError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise InputError(name, f"cannot be made ({_failure(error)})") from error
    raise InputError(name, next(iter(settings)), "this object has no settings; only dataclasses have settings")


def _failure(error: BaseException) -> str:
    from interdrive.foreign import failure  # noqa: PLC0415 - numpy

    return failure(error)
