"""What the page of a run shows, read from its folder: a header for JSON and packed arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.criticality import MEASURES, measure_named
from interdrive.errors import InterdriveError
from interdrive.plots.measures import LEVELS
from interdrive.plots.style import agent_colors
from interdrive.plots.vehicles import body_outlines, outlines
from interdrive.plots.view import View, view_of
from interdrive.report.contract import FORMAT
from interdrive.report.cooperation import pack_cooperation
from interdrive.report.events import Event, events_of
from interdrive.report.measured import Measured, measured_of
from interdrive.report.packing import Packer
from interdrive.report.priorities import pack_priorities
from interdrive.report.tables import (
    pack_candidates,
    pack_plans,
    pack_predictions,
    pack_road,
    pack_states,
    pack_stop_lines,
    pack_views,
)
from interdrive.report.traffic import flows_of
from interdrive.results import read_part, read_results, sumo_names, with_cooperation, with_demand, with_routes
from interdrive.run import PLAN_STATUS
from interdrive.run.logs import steps_between
from interdrive.scoring import score, score_table, stored_score
from interdrive.storage import is_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Floats
    from interdrive.criticality import Measure
    from interdrive.report import contract
    from interdrive.report.contract import BatchHeader, Missing, Participant, RunEvent, RunHeader
    from interdrive.results import Results, RunInformation
    from interdrive.run import RunRecord


@dataclass(frozen=True)
class Contents:
    """What goes into a page: a header of plain values, and arrays as text."""

    header: RunHeader | BatchHeader
    arrays: str


def run_contents(folder: str | Path) -> Contents:
    """Everything about a run that its page shows.

    Raises:
        ResultsError: if the folder is no run folder, or damaged, or of another format.
        InputError: if its scenario cannot be read.
    """
    results = read_results(folder, in_part=True)
    run = read_part(folder, results)
    view = view_of(run)
    packer, lacking, origin = Packer(), _lacking(results), _origin(view)
    pack_states(packer, run, origin)
    pack_road(packer, run, origin)
    pack_stop_lines(packer, run, origin)
    pack_priorities(packer, run.scenario, origin)
    settings = _settings(results.info)
    replan_every = int(settings.get("step.replan_every", 1))
    pack_plans(packer, run, origin, results.plans, replan_every)
    pack_views(packer, run, results.views)
    reasons = pack_candidates(packer, run, origin, results.candidates)
    if reasons:
        seconds = float(settings.get("record.candidate_spacing", 0.0))
        spacing = steps_between(seconds, run.scenario.dt, replan_every)
        packer.header["candidate_step"]["spacing"] = min(spacing, run.states.n_steps)
    pack_predictions(packer, run, origin, results.predictions)
    told = with_cooperation(run, results)
    pack_cooperation(packer, told, origin, float(settings.get("v2x.age_max", np.inf)))
    try:
        measured = measured_of(Path(folder), run)
    except InterdriveError as cause:
        measured = None
        lacking.append({"what": "criticality", "text": f"Criticality cannot be evaluated: {cause}"})
    if measured is not None:
        packer.add("measure", measured.value)
        packer.add("measure_partner", measured.partner)
    info = results.info
    header: RunHeader = {
        "format": FORMAT,
        "kind": "run",
        "name": run.scenario.name,
        "benchmark_id": run.scenario.benchmark_id,
        "dt": run.scenario.dt,
        "first_time_step": run.states.first_time_step,
        "n_steps": run.states.n_steps,
        "view": {"angle": view.angle, "width": view.width, "height": view.height},
        "origin": (float(origin[0]), float(origin[1])),
        "participants": _participants(run, results, origin, _scores(Path(folder), run, results, lacking), measured),
        "statuses": list(PLAN_STATUS),
        "reasons": reasons,
        "measures": [] if measured is None else [_measure(measure) for measure in MEASURES],
        "events": [
            _event(event) for event in events_of(told, results.plans, measured, replan_every, results.violations)
        ],
        "missing": lacking,
        "info": {
            "digest": info.get("digest", ""),
            "settings": {**info.get("settings", {})},
            "versions": {**info.get("versions", {})},
            "platform": {**info.get("platform", {})},
            "notes": info.get("notes", []),
            "seed": info.get("seed"),
        },
        "arrays": packer.header,
    }
    flows = flows_of(with_demand(run, results))
    if flows is not None:
        header["flows"] = flows
    return Contents(header, packer.text())


def _lacking(results: Results) -> list[Missing]:
    """What a reader might look for in vain, and how to get it."""
    found: list[Missing] = []
    if results.plans.num_rows == 0:
        found.append({"what": "plans", "text": "No plans: plans.parquet is missing or empty."})
    if results.predictions is None:
        text = "Predictions were not recorded; run with --report or --set record.predictions=true."
        found.append({"what": "predictions", "text": text})
    if results.candidates is None:
        text = "Sampled candidates were not recorded; run with --report or --set record.candidates=30."
        found.append({"what": "candidates", "text": text})
    elif results.candidates.num_rows == 0:
        found.append({"what": "candidates", "text": "No agent has a planner whose candidates can be recorded."})
    if results.views is None:
        text = "Visibility was not recorded; run with --report or --set record.views=true."
        found.append({"what": "views", "text": text})
    if results.info.get("cooperation") is not None and results.messages is None:
        text = "Messages were not recorded; run with --report or --set record.messages=links."
        found.append({"what": "links", "text": text})
    if results.info.get("demand") is not None and results.demand is None:
        found.append({"what": "flows", "text": "No flows of generated traffic: demand.parquet is missing."})
    return found


def _origin(view: View) -> Floats:
    """Positions are stored relative to this point [m], the middle of what is shown first."""
    angle = View(-view.angle, (0.0, 0.0), 0.0, 0.0)
    origin: Floats = np.round(angle.picture_from_world(np.array(view.center)))
    return origin


def _scores(
    folder: Path, run: RunRecord, results: Results, lacking: list[Missing]
) -> dict[int, tuple[float | None, str]]:
    """Score of every agent and why it is not 1: as stored, or evaluated with the defaults."""
    try:
        found = stored_score(folder)
        if found is None or not is_of(found, run.digest):
            found = score_table(score(with_routes(run, results)))
    except InterdriveError as cause:
        lacking.append({"what": "score", "text": f"Scores cannot be evaluated: {cause}"})
        return {}
    return {row["agent_id"]: (row["score"], row["why"] or "") for row in found.to_pylist()}


def _participants(
    run: RunRecord,
    results: Results,
    origin: Floats,
    scores: Mapping[int, tuple[float | None, str]],
    measured: Measured | None,
) -> list[Participant]:
    """One entry per row of the states: what does not change."""
    states, colors = run.states, agent_colors(run)
    order = {number: index for index, number in enumerate(run.outcomes.agent_id.tolist())}
    ended = results.outcomes.to_pylist()
    agents = {agent.id: agent for agent in run.agents}
    named = sumo_names(results)
    made = []
    for row, number in enumerate(states.participant_id.tolist()):
        entry: Participant = {
            "id": number,
            "kind": states.kinds[row],
            "length": round(float(states.length[row]), 2),
            "width": round(float(states.width[row]), 2),
            "static": bool(states.is_static[row]),
            "agent": -1,
        }
        if number in named:
            entry["name"] = named[number]
        shape = _body(run, row)
        if shape is not None:
            entry["outlines"] = [np.round(line, 2).tolist() for line in shape]
        if number in order:
            agent, outcome = agents[number], ended[order[number]]
            sensor_radius, occlusion = _sight(results.info, number)
            goal = [line for area in agent.goal_areas for line in outlines(area)]
            entry |= {
                "agent": order[number],
                "color": colors[number],
                "planner": outcome["planner"],
                "outcome": outcome["outcome"],
                "end": outcome["time_step"] - states.first_time_step,
                "harm": outcome["harm"],
                "ttc": _least_ttc(measured, order[number]),
                "reason": ", ".join(filter(None, (outcome["reason"], _swung_out(outcome["off_lanelets"])))),
                "goal": [np.round(line - origin, 2).tolist() for line in goal],
                "sensor_radius": sensor_radius,
                "occlusion": occlusion,
            }
            if number in scores:
                entry["score"], entry["why"] = scores[number]
        made.append(entry)
    return made


def _least_ttc(measured: Measured | None, place: int) -> str:
    value = None if measured is None else float(measured.extreme[MEASURES.index(measure_named("ttc")), place])
    return measure_named("ttc").text(value, with_unit=False)


def _swung_out(off_lanelets: float) -> str:
    return f"up to {off_lanelets:.2f} m beyond the lanelets" if off_lanelets >= 0.01 else ""


def _body(run: RunRecord, row: int) -> list[Floats] | None:
    """Outlines of a participant that is not a plain rectangle about its centre, otherwise None."""
    obstacles = run.scenario.obstacles
    at = np.flatnonzero(obstacles.ids == run.states.participant_id[row])
    if not len(at):
        return None
    shape = obstacles.shapes[int(at[0])]
    if shape.kind == "rectangle" and shape.center == (0.0, 0.0) and shape.orientation == 0.0:
        return None
    return body_outlines(run)[row]


def _settings(info: RunInformation) -> Mapping[str, Any]:
    """All settings by their dotted names, checked when they were read."""
    return info.get("settings", {}).get("settings", {})


def _sight(info: RunInformation, number: int) -> tuple[float | None, bool]:
    """How far an agent sees [m] (None: without limit), and whether others hide each other."""
    values = {**_settings(info), **_dotted(info.get("settings", {}).get("views", {}).get(str(number), {}))}
    radius = values.get("view.sensor_radius")
    far = None if radius is None or not np.isfinite(float(radius)) else float(radius)
    return far, bool(values.get("view.occlusion", False))


def _dotted(own: Mapping[str, Any]) -> dict[str, Any]:
    return {f"view.{name.removeprefix('view.')}": value for name, value in own.items()}


def _measure(measure: Measure) -> contract.Measure:
    return {
        "name": measure.name,
        "title": measure.title,
        "unit": measure.unit,
        "grows": measure.grows,
        "cap": measure.drawn_to if np.isfinite(measure.drawn_to) else None,
        "horizon": measure.horizon if np.isfinite(measure.horizon) else None,
        "level": LEVELS.get(measure.name),
    }


def _event(event: Event) -> RunEvent:
    said: RunEvent = {"step": event.step, "kind": event.kind, "rows": list(event.rows), "text": event.text}
    if event.value is not None:
        said["value"] = event.value
    return said
