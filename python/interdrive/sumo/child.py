"""A process with one simulation of SUMO, which may end without taking the run with it.

It answers one line of JSON for each line that it reads; what SUMO prints goes to its standard error. When there is
nothing more to read it removes the folder that it runs in.

Requests: first the options of SUMO and the time steps before the run; then, for each time step, the agents that are
new or gone, where agents will be, and which of SUMO's participants leave. Answers: SUMO's participants, and what is new
of them. Participants are called by their domain, vehicle or person, and their name, as both may have the same names.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from array import array
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing import TextIO

#: Vehicles of the route files that the agents stand in for begin with this.
_STOOD_IN_FOR = "egoVehicle"
#: Agents do as they are told: no check of speeds, no change of lanes by SUMO.
_NO_CHECKS = 0


class Simulation:
    """SUMO's simulation.

    Names of agents begin with `prefix`.
    """

    def __init__(self, sumo: Any, options: list[str], delta_steps: int, prefix: str) -> None:  # noqa: ANN401 - no types
        self._sumo, self._delta_steps, self._prefix = sumo, delta_steps, prefix
        self._known: set[tuple[str, str]] = set()
        self._at: dict[int, tuple[float, float, float]] = {}
        sumo.start(["sumo", *options])

    def before(self, steps: int) -> dict[str, Any]:
        """Simulates time steps without agents."""
        for _ in range(steps * self._delta_steps):
            self._sumo.simulationStep()
        return self._there()

    def step(self, request: dict[str, Any]) -> dict[str, Any]:
        """One time step."""
        vehicle, person = self._sumo.vehicle, self._sumo.person
        there = set(vehicle.getIDList())
        for number in request["ended"]:
            self._at.pop(number, None)
            if self._prefix + str(number) in there:
                vehicle.remove(self._prefix + str(number))
        people = set(person.getIDList())
        for domain, name in request["leaving"]:
            if domain == "vehicle" and name in there:
                vehicle.remove(name)
            elif domain == "person" and name in people:
                person.removeStages(name)
        for number, length, width, *place in request["new"]:
            self._add_type(f"{self._prefix}{number}", length, width)
            self._at[number] = (place[0], place[1], place[2])
        for light, letters in request["lights"]:
            state = list(self._sumo.trafficlight.getRedYellowGreenState(light))
            for place, letter in letters:
                state[place] = letter
            self._sumo.trafficlight.setRedYellowGreenState(light, "".join(state))
        for part in range(1, self._delta_steps + 1):
            self._move(request["agents"], part / self._delta_steps)
            self._sumo.simulationStep()
        self._at = {number: (x, y, angle) for number, x, y, angle, _ in request["agents"]}
        return self._there()

    def _move(self, agents: list[tuple[int, float, float, float, float]], share: float) -> None:
        """Puts agents where they are after a share of the time step; SUMO forgets those that leave its roads."""
        vehicle = self._sumo.vehicle
        there = {*vehicle.getIDList(), *self._sumo.simulation.getPendingVehicles()}
        for number, x, y, angle, speed in agents:
            name = f"{self._prefix}{number}"
            x0, y0, angle0 = self._at[number]
            at = x0 + share * (x - x0), y0 + share * (y - y0)
            if name not in there:
                self._add(name, at)
            turned = angle0 + share * math.remainder(angle - angle0, 360.0)
            vehicle.moveToXY(name, "", -1, *at, turned % 360.0, keepRoute=2)
            vehicle.setSpeed(name, speed)

    def _add_type(self, name: str, length: float, width: float) -> None:
        types = self._sumo.vehicletype
        types.copy("DEFAULT_VEHTYPE", name)
        types.setLength(name, length)
        types.setWidth(name, width)
        types.setVehicleClass(name, "ignoring")  # whatever drives, it is there

    def _add(self, name: str, place: tuple[float, float]) -> None:
        sumo = self._sumo
        try:
            edge = sumo.simulation.convertRoad(*place)[0]
        except sumo.TraCIException:  # far from all roads
            edge = next(one for one in sumo.edge.getIDList() if not one.startswith(":"))
        if name not in sumo.route.getIDList():
            sumo.route.add(name, [edge])
        sumo.vehicle.add(name, name, typeID=name)
        sumo.vehicle.setSpeedMode(name, _NO_CHECKS)
        sumo.vehicle.setLaneChangeMode(name, _NO_CHECKS)

    def _there(self) -> dict[str, Any]:
        """SUMO's own participants and what is new of them.

        For each its domain and name, and six numbers: front, angle, speed across and along, and acceleration. The bytes
        of the numbers are in hexadecimal digits, which is faster than decimal ones.
        """
        names, numbers, new = [], array("d"), []
        own = self._sumo.vehicle
        for name in own.getIDList():
            if name.startswith(self._prefix):
                continue
            if name.startswith(_STOOD_IN_FOR):
                own.remove(name)
                continue
            names.append(("vehicle", name))
            motion = own.getAngle(name), own.getLateralSpeed(name), own.getSpeed(name), own.getAcceleration(name)
            numbers.extend((*own.getPosition(name), *motion))
            if ("vehicle", name) not in self._known:
                new.append(("vehicle", name, own.getVehicleClass(name), own.getLength(name), own.getWidth(name)))
        own = self._sumo.person
        for name in own.getIDList():
            names.append(("person", name))
            numbers.extend((*own.getPosition(name), own.getAngle(name), 0.0, own.getSpeed(name), 0.0))
            if ("person", name) not in self._known:
                size = max(own.getLength(name), own.getWidth(name))
                new.append(("person", name, "pedestrian", size, size))
        self._known.update((domain, name) for domain, name, *_ in new)
        return {"there": names, "numbers": numbers.tobytes().hex(), "new": new}


def main(requests: TextIO, answers: TextIO) -> int:
    """Answers requests until there are no more; what goes wrong is the last answer."""
    import libsumo  # noqa: PLC0415 - takes a third of a second

    simulation: Simulation | None = None
    for line in requests:
        request = json.loads(line)
        try:
            if simulation is None:
                simulation = Simulation(libsumo, request["options"], request["delta_steps"], request["prefix"])
                answer = {"version": libsumo.getVersion()[1], **simulation.before(request["before"])}
            else:
                answer = simulation.step(request)
        except libsumo.TraCIException as error:
            answer = {"error": " ".join(str(error).split())}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()
        if "error" in answer:
            return 1
    return 0


if __name__ == "__main__":
    # SUMO prints to standard output: answers keep it, and all else goes to standard error.
    kept = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    try:
        code = main(sys.stdin, kept)
    except BrokenPipeError:  # the run is gone
        code = 1
    if not sys.stdin.readline():  # nobody will read what it said
        shutil.rmtree(Path.cwd(), ignore_errors=True)
    os._exit(code)
