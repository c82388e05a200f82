"""Which choices and settings of two runs differ."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from interdrive.results.information import RunInformation
    from interdrive.run import Json

#: Choices besides settings, in the order in which they are told.
_CHOICES = ("agents", "planner", "predictor", "views", "rules", "v2x", "seed")
#: These change nothing that a run does.
_SILENT = ("record.",)
#: What stands for a value that a run does not have.
_NONE = "-"


def differing_settings(one: RunInformation, other: RunInformation) -> list[tuple[str, str, str]]:
    """Names of what differs, each with its value in both runs: choices first, then settings by name, then versions.

    Records (`record.*`) and threads are left out, because they change nothing that a run does.

    Args:
        one: Contents of run.json.
        other: Of the other run.
    """
    ids = {str(agent["id"]) for info in (one, other) for agent in info.get("agents", ())}
    chosen: list[dict[str, Any]] = [dict(info.get("settings", {})) for info in (one, other)]
    by_agent = any(_is_by_agent(settings.get("planner"), ids) for settings in chosen)
    for settings in chosen:
        if by_agent and not _is_by_agent(settings.get("planner"), ids):
            settings["planner"] = dict.fromkeys(sorted(ids, key=int), settings.get("planner"))
    first, second = (_told(info, settings) for info, settings in zip((one, other), chosen, strict=True))
    pairs = [(name, first.get(name, _NONE), second.get(name, _NONE)) for name in dict.fromkeys((*first, *second))]
    return [pair for pair in pairs if pair[1] != pair[2]]


def _is_by_agent(planner: Json, ids: set[str]) -> bool:
    return isinstance(planner, dict) and not ids.isdisjoint(planner)


def _told(info: RunInformation, settings: dict[str, Any]) -> dict[str, str]:
    told: dict[str, str] = {}
    for name in _CHOICES:
        told |= _flat(name, settings.get(name))
    for name, value in sorted((settings.get("settings") or {}).items()):
        if not name.startswith(_SILENT):
            told[name] = _text(value)
    versions: dict[str, Any] = dict(info.get("versions", {}))
    return told | {f"version of {name}": _text(value) for name, value in sorted(versions.items())}


def _flat(name: str, value: Json) -> dict[str, str]:
    """A choice, or what it says for each agent and setting."""
    if not isinstance(value, dict):
        return {name: _text(value)} if value is not None else {}
    found: dict[str, str] = {}
    for key, inner in value.items():
        found |= _flat(f"{name}.{key}", inner)
    return found


def _text(value: Json) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return ",".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
