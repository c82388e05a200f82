"""What the traffic lights of a map show over time, by a table that calls them as the map does."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.files.control import lights_of_ways
from interdrive.files.sources.control import cycle_of
from interdrive.files.sources.model import DARK, Light

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.files.sources.model import LightStates
    from interdrive.files.sources.notes import Notes
    from interdrive.scenario import Lanelets, Scenario, StopLine, TrafficLight


def with_states(
    scenario: Scenario, states: Mapping[str, LightStates], clock: tuple[float, float], notes: Notes
) -> Scenario:
    """The scenario with lights that show what a table says.

    Args:
        scenario: Its source labels its lights, if the map does.
        states: What lights show, by their labels.
        clock: Time between steps of the scenario, and time of step 0 [s], in the times of the states.
        notes: Labels that no light has are counted.
    """
    if not states:
        return scenario
    labels = dict(scenario.source.lights) if scenario.source is not None else {}
    lights = {
        light.id: _shown(light, labels[light.id], states[labels[light.id]], clock, notes)
        for light in scenario.traffic_lights
        if labels.get(light.id) in states
    }
    for label in sorted(set(states) - {labels[number] for number in lights}):
        notes.name("states of traffic lights that the map does not name left out, lights", label)
    on_red = {number for number in lights if states[labels[number]].turns_on_red}
    rows = {number: row for row, number in enumerate(scenario.lanelets.ids.tolist())}
    found = tuple(lights.get(light.id, light) for light in scenario.traffic_lights)
    by_id = {light.id: light for light in found}
    lines = tuple(_with_turns(line, scenario.lanelets, rows, by_id, on_red) for line in scenario.stop_lines)
    dark = sum(not light.phases for light in found)
    rest = tuple(note for note in scenario.notes if not note.startswith(DARK))
    return replace(scenario, traffic_lights=found, stop_lines=lines, notes=(*rest, f"{DARK}: {dark}") if dark else rest)


def _shown(
    light: TrafficLight, label: str, states: LightStates, clock: tuple[float, float], notes: Notes
) -> TrafficLight:
    cycle = cycle_of(Light(label, 0, phases=states.phases, begin=states.begin, repeats=False), clock, notes)
    return replace(light, phases=cycle[0], offset=cycle[1])


def _with_turns(
    line: StopLine,
    lanelets: Lanelets,
    rows: Mapping[int, int],
    lights: Mapping[int, TrafficLight],
    on_red: set[int],
) -> StopLine:
    """The line, onto the lanelets to the right of which drivers may turn on red if they may at one of its lights."""
    own = {number for _, numbers in line.light_ids for number in numbers}
    if not own & on_red:
        return line
    shown = [lights[number] for number in sorted(own)]
    _, turns = lights_of_ways(lanelets, rows, line.lanelet_id, shown, {}, on_red=True)
    return replace(line, turns_on_red=turns, is_stated=line.is_stated or bool(turns))
