"""Scores of agents against a panel: what its drivers reach in their place, and what others lose by the agents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError, InterdriveError
from interdrive.panel.stored import Asked, PanelFolder
from interdrive.panel.worlds import World
from interdrive.scoring import ScoringSettings, has_recording
from interdrive.scoring import score as absolute_score
from interdrive.scoring.drive_facts import drives_of
from interdrive.scoring.evaluation import evaluated, scored_agents
from interdrive.scoring.hindrance import Hindrance, Undisturbed, hindrance_of
from interdrive.scoring.judgement import PanelDrives

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.runs import Run
    from interdrive.scoring import Score
    from interdrive.scoring.drive_facts import Drive

#: The drivers of the panel: four that differ in design, each with its default settings.
PANEL = ("lawful", "idm", "idm_mobil", "rollout")

#: How a panel is named: its drivers, none at all, or a folder.
DEFAULT, NONE = "default", "none"

#: Around the reason why a stored panel has nothing in the place of an agent.
_LACKS, _DRIVEN_ANEW = " as it is needed: ", "; its drivers drove anew"

_SEVERAL = "several agents are scored: what each of them costs the others is not measured"


def score(
    run: Run,
    ids: Sequence[int] | None = None,
    settings: ScoringSettings | None = None,
    *,
    panel: str | Path | PanelFolder | Sequence[str] | None = None,
    trust: bool = False,
    threads: int | None = 1,
    on_agent: Callable[[int, int], None] | None = None,
) -> Score:
    """Scores agents of a run against a panel of drivers that drive in the place of each.

    The reference, page "Scores", defines all parts. Hindrance is measured if one agent is scored and others react; it
    is absent otherwise.

    Args:
        run: A run with its routes, as `simulate` and `load` give it.
        ids: Agents; None: all whose recordings overlap no others.
        settings: Bounds, weights and reactions; the defaults otherwise.
        panel: "default"; "none": scores are absolute, and nothing is simulated; the folder of a stored panel; or names
            of native planners. None: "default" if one agent is scored and the run can be repeated, otherwise "none".
        trust: Import planners of other agents that the run names as module:object.
        threads: Number of planning threads; results do not depend on it.
        on_agent: Called after every agent with how many are done, and how many there are.

    Raises:
        InputError: An id is not that of an agent, the run cannot be repeated, or there is no such panel.
    """
    chosen = settings or ScoringSettings()
    wanted = scored_agents(run, ids)
    drivers, stored = chosen_panel(panel, DEFAULT if len(wanted) == 1 else NONE)
    if not drivers:
        return absolute_score(run, wanted, chosen)
    if panel is None:
        try:
            World.of(run, wanted[0], trust=trust)
        except InputError:
            return absolute_score(run, wanted, chosen)
    if not has_recording(run):
        if panel is None:
            return absolute_score(run, wanted, chosen)
        raise InputError("score: the scenario file is gone or has changed, so no driver can take the agents' place")
    done = 0

    def place(drive: Drive) -> tuple[Drive, PanelDrives, Hindrance]:
        nonlocal done
        world = World.of(run, drive.agent_id, trust=trust, threads=threads)
        found = panel_drives(world, drivers, chosen, measures_hindrance=len(wanted) == 1, stored=stored)
        own, driven = drive, run
        if stored is None or not stored.is_complete:
            own, driven = _on_after_hits(drive, run, world, chosen)
        taken = Hindrance() if found.without is None else hindrance_of(own, driven, found.without)
        done += 1
        if on_agent is not None:
            on_agent(done, len(wanted))
        return own, found, taken

    return evaluated(run, wanted, chosen, place, panel=drivers, notes=[_SEVERAL] if len(wanted) > 1 else [])


def chosen_panel(
    panel: str | Path | PanelFolder | Sequence[str] | None, usual: str = DEFAULT
) -> tuple[tuple[str, ...], PanelFolder | None]:
    """Names of the drivers of a panel, and where their drives are stored; `usual` is what None means.

    Raises:
        InputError: A folder that is no stored panel.
    """
    given = usual if panel is None else panel
    if isinstance(given, PanelFolder):
        return given.drivers, given
    if given == DEFAULT:
        return PANEL, None
    if given == NONE:
        return (), None
    if isinstance(given, str | Path):
        found = PanelFolder.open(given)
        return found.drivers, found
    return tuple(given), None


def _on_after_hits(drive: Drive, run: Run, world: World, settings: ScoringSettings) -> tuple[Drive, Run]:
    """The drive as it goes on after others hit the agent, and its run; as it is if nothing repeats it."""
    again = world.driven_on() if drive.hit else None
    if again is None:
        return drive, run
    on = drives_of(again, [drive.agent_id], settings)[drive.agent_id]
    n = len(drive.time)
    same = len(on.time) >= n and np.array_equal(on.s[:n], drive.s)
    return (on, again) if same and np.array_equal(on.velocity[:n], drive.velocity) else (drive, run)


def panel_drives(
    world: World,
    panel: Sequence[str],
    settings: ScoringSettings,
    *,
    measures_hindrance: bool,
    stored: PanelFolder | None = None,
) -> PanelDrives:
    """Drives in the place of an agent, and the world without it.

    Args:
        world: The world of the agent.
        panel: Names of native planners.
        settings: Bounds of the terms.
        measures_hindrance: The world is driven without the agent, too, if others react.
        stored: Drives that are there already.

    Raises:
        InputError: They are not stored, and a complete panel was asked for.
    """
    if stored is None:
        return _driven(world, panel, settings, measures_hindrance=measures_hindrance)
    asked = Asked.of(world, panel, settings, measures_hindrance=measures_hindrance)
    found = stored.find(asked.key)
    if found is not None:
        return found
    if stored.is_complete:
        has = f"; it has {stored.about}" if stored.about else ""
        raise InputError(
            f"{stored.path}: nothing in the place of agent {world.agent_id} of {world.scenario.name}{_LACKS}"
            f"{stored.why_not(asked)}{has}"
        )
    made = _driven(world, panel, settings, measures_hindrance=measures_hindrance)
    if stored.writes:
        stored.keep(asked, made)
        return made
    told = f"{stored.path} lacks the place of agent {world.agent_id}{_LACKS}{stored.why_not(asked)}{_DRIVEN_ANEW}"
    return replace(made, notes=(*made.notes, told))


def why_driven_anew(notes: Sequence[str]) -> str:
    """Why a stored panel had nothing in a place, by the notes on the drives there; "" if it had, or there is none."""
    told = (note for note in notes if _LACKS in note and note.endswith(_DRIVEN_ANEW))
    return next((note.partition(_LACKS)[2].removesuffix(_DRIVEN_ANEW) for note in told), "")


def _driven(world: World, panel: Sequence[str], settings: ScoringSettings, *, measures_hindrance: bool) -> PanelDrives:
    without, notes = None, []
    if measures_hindrance and world.reacts:
        try:
            without = Undisturbed.of(world.without_agent())
        except InterdriveError as error:
            notes.append(f"what others lose is not measured: the world without {world.agent_id} fails ({error})")
    drives, hindrances = {}, {}
    for name in panel:
        again = world.driven_by(name)
        drive = drives_of(again, [world.agent_id], settings).get(world.agent_id)
        if drive is None:
            continue
        drives[name] = drive
        if without is not None:
            hindrances[name] = hindrance_of(drive, again, without)
    return PanelDrives(drives, hindrances, without, tuple(notes))
