"""A process with one simulation of SUMO, which may end without taking the run with it.

It answers one line of JSON for each line that it reads; what SUMO prints goes to its standard error.

Requests: first the options of SUMO and the time steps before the run; then, for each time step, the agents that are
new or gone, where agents will be, and which of SUMO's vehicles leave. Answers: SUMO's participants, and what is new of
them.
"""

from __future__ import annotations

import json
import os
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing import TextIO

#: Names of agents within SUMO begin with this.
_OURS = "interdrive_"
#: Vehicles of the route files that the agents stand in for begin with this.
_STOOD_IN_FOR = "egoVehicle"
#: Agents do as they are told: no check of speeds, no change of lanes by SUMO.
_NO_CHECKS = 0


class Simulation:
    """SUMO's simulation."""

    def __init__(self, sumo: Any, options: list[str], delta_steps: int) -> None:  # noqa: ANN401 - no types
        self._sumo, self._delta_steps = sumo, delta_steps
        self._known: set[str] = set()
        sumo.start(["sumo", *options])

    def before(self, steps: int) -> dict[str, Any]:
        """Simulates time steps without agents; those that agents stand in for leave."""
        for _ in range(steps * self._delta_steps):
            self._sumo.simulationStep()
        for name in self._sumo.vehicle.getIDList():
            if name.startswith(_STOOD_IN_FOR):
                self._sumo.vehicle.remove(name)
        return self._there()

    def step(self, request: dict[str, Any]) -> dict[str, Any]:
        """One time step."""
        vehicle = self._sumo.vehicle
        there = set(vehicle.getIDList())
        for name in [*(_OURS + str(number) for number in request["ended"]), *request["leaving"]]:
            if name in there:
                vehicle.remove(name)
        for number, length, width, x, y in request["new"]:
            self._add(f"{_OURS}{number}", length, width, (x, y))
        for number, x, y, angle, speed in request["agents"]:
            vehicle.moveToXY(f"{_OURS}{number}", "", -1, x, y, angle, keepRoute=2)
            vehicle.setSpeed(f"{_OURS}{number}", speed)
        for light, letters in request["lights"]:
            state = list(self._sumo.trafficlight.getRedYellowGreenState(light))
            for place, letter in letters:
                state[place] = letter
            self._sumo.trafficlight.setRedYellowGreenState(light, "".join(state))
        for _ in range(self._delta_steps):
            self._sumo.simulationStep()
        return self._there()

    def _add(self, name: str, length: float, width: float, place: tuple[float, float]) -> None:
        sumo = self._sumo
        edge, _, _ = sumo.simulation.convertRoad(*place)
        sumo.vehicletype.copy("DEFAULT_VEHTYPE", name)
        sumo.vehicletype.setLength(name, length)
        sumo.vehicletype.setWidth(name, width)
        sumo.route.add(name, [edge])
        sumo.vehicle.add(name, name, typeID=name)
        sumo.vehicle.setSpeedMode(name, _NO_CHECKS)
        sumo.vehicle.setLaneChangeMode(name, _NO_CHECKS)

    def _there(self) -> dict[str, Any]:
        """SUMO's own participants and what is new of them.

        For each its name, front, angle, speed across and along, and acceleration.
        """
        sumo = self._sumo
        rows, new = [], []
        for name in sumo.vehicle.getIDList():
            if name.startswith((_OURS, _STOOD_IN_FOR)):
                continue
            own = sumo.vehicle
            x, y = own.getPosition(name)
            rows.append(
                (
                    name,
                    x,
                    y,
                    own.getAngle(name),
                    own.getLateralSpeed(name),
                    own.getSpeed(name),
                    own.getAcceleration(name),
                )
            )
            if name not in self._known:
                new.append((name, own.getVehicleClass(name), own.getLength(name), own.getWidth(name)))
        for name in sumo.person.getIDList():
            own = sumo.person
            x, y = own.getPosition(name)
            rows.append((name, x, y, own.getAngle(name), 0.0, own.getSpeed(name), 0.0))
            if name not in self._known:
                new.append((name, "pedestrian", own.getLength(name), own.getWidth(name)))
        self._known.update(row[0] for row in new)
        return {"there": rows, "new": new}


def main(requests: TextIO, answers: TextIO) -> int:
    """Answers requests until there are no more; what goes wrong is the last answer."""
    import libsumo  # noqa: PLC0415 - takes a third of a second

    simulation: Simulation | None = None
    for line in requests:
        request = json.loads(line)
        try:
            if simulation is None:
                simulation = Simulation(libsumo, request["options"], request["delta_steps"])
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
    sys.exit(main(sys.stdin, kept))
