"""The score of agents against a panel: what its drivers reach in their place, and what others lose by them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError, InterdriveError
from interdrive.panel.stored import PanelFolder, key_of
from interdrive.panel.worlds import World
from interdrive.scoring import ScoringSettings, has_recording
from interdrive.scoring.drive_facts import drives_of
from interdrive.scoring.hindrance import Hindrance, Undisturbed, hindrance_of
from interdrive.scoring.judgement import PanelDrives, judged

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Ints
    from interdrive.runs import Run
    from interdrive.scoring.drive_facts import Drive
    from interdrive.scoring.total import Facts, Total

#: The drivers of the panel: four that differ in design, each with its default settings.
PANEL = ("lawful", "idm", "idm_mobil", "rollout")

_SEVERAL = "several agents are scored: what each of them costs the others is not measured"


@dataclass(frozen=True)
class PanelScore:
    """Scores of agents against a panel; sequences in the order of `ids`.

    Attributes:
        ids: Agents, ascending.
        planners: Names of their planners.
        facts: What decided. totals: The scores with all their parts.
        hits: How often others hit them without their fault.
        hindrances: What others lost.
        reasons: In words, what made the score less than 1.
        panel: Drivers of the panel; empty: none, and scores are absolute.
        notes: One line per thing the user should know.
    """

    ids: Ints
    planners: tuple[str, ...]
    facts: tuple[Facts, ...]
    totals: tuple[Total, ...]
    hits: tuple[int, ...]
    hindrances: tuple[Hindrance, ...]
    reasons: tuple[tuple[str, ...], ...]
    panel: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def score(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """From 0 to 1."""
        return np.array([one.score for one in self.totals], dtype=np.float64)

    def __repr__(self) -> str:
        mean = f", mean {100.0 * float(self.score.mean()):.1f}" if len(self.ids) else ""
        return f"<PanelScore of {len(self.ids)} agents{mean}>"

    def why(self, agent_id: int) -> str:
        """Why the agent with id `agent_id` has no higher score, in one line.

        Raises:
            InputError: It was not scored.
        """
        rows = np.flatnonzero(self.ids == agent_id)
        if not len(rows):
            raise InputError(f"agent {agent_id} was not scored")
        return "; ".join(self.reasons[int(rows[0])]) or "full score"


def panel_score(
    run: Run,
    ids: Sequence[int] | None = None,
    settings: ScoringSettings | None = None,
    *,
    panel: Sequence[str] = PANEL,
    stored: PanelFolder | None = None,
    trust: bool = False,
    threads: int | None = 1,
    on_agent: Callable[[int, int], None] | None = None,
) -> PanelScore:
    """Scores agents of a run against a panel of drivers that drive in the place of each.

    The reference, page "Scores against a panel", defines all parts. Hindrance is measured if one agent is scored and
    others react; it is absent otherwise.

    Args:
        run: A run with its routes, as `simulate` and `load` give it.
        ids: Agents; None: all whose recordings overlap no others.
        settings: Bounds, weights and reactions; the defaults otherwise.
        panel: Names of native planners; empty: no panel, scores are absolute.
        stored: Drives of the panel that are there already; its drivers are those of `panel`.
        trust: Import planners of other agents that the run names as module:object.
        threads: Number of planning threads; results do not depend on it.
        on_agent: Called after every agent with how many are done, and how many there are.

    Raises:
        InputError: An id is not that of an agent, or the run cannot be repeated.
    """
    chosen = settings or ScoringSettings()
    overlapping = run.scenario.overlapping
    wanted = sorted(set(run.outcomes.agent_id.tolist() if ids is None else ids) - set(overlapping))
    own = drives_of(run, wanted, chosen)
    if not has_recording(run):
        raise InputError("score: the scenario file is gone or has changed, so no driver can take the agents' place")
    notes = [_SEVERAL] if len(own) > 1 else []
    found = []
    for number in list(own):
        drive, place, driven = own[number], PanelDrives(), run
        if panel or len(own) == 1 or drive.hit:
            world = World.of(run, number, trust=trust, threads=threads)
            place = panel_drives(world, panel, chosen, measures_hindrance=len(own) == 1, stored=stored)
            if stored is None or not stored.is_complete:
                drive, driven = _on_after_hits(drive, run, world, chosen)
        own[number] = drive
        taken = Hindrance() if place.without is None else hindrance_of(drive, driven, place.without)
        found.append((*judged(drive, taken, place, chosen), taken))
        notes += [note for note in place.notes if note not in notes]
        if on_agent is not None:
            on_agent(len(found), len(own))
    return PanelScore(
        ids=np.array(list(own), dtype=np.int64),
        planners=tuple(drive.planner for drive in own.values()),
        facts=tuple(one[0] for one in found),
        totals=tuple(one[1] for one in found),
        hits=tuple(len(drive.hits) + bool(drive.hit) for drive in own.values()),
        hindrances=tuple(one[3] for one in found),
        reasons=tuple(one[2] for one in found),
        panel=tuple(panel),
        notes=tuple(notes),
    )


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
    key = "" if stored is None else key_of(world, panel, settings, measures_hindrance=measures_hindrance)
    found = None if stored is None else stored.find(key)
    if found is not None:
        return found
    if stored is not None and stored.is_complete:
        raise InputError(
            f"{stored.path}: nothing in the place of agent {world.agent_id} of {world.scenario.name} with this traffic "
            f"and predictor ({f'no {key}' if key else 'it depends on code or files of yours'})"
            + (f"; it has {stored.about}" if stored.about else "")
        )
    made = _driven(world, panel, settings, measures_hindrance=measures_hindrance)
    if stored is not None:
        stored.keep(key, made)
    return made


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
