"""SUMO's part of a scenario: the files that it simulates, and how."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class SumoTraffic:
    """Traffic that SUMO drives.

    Attributes:
        config: Name of the configuration file of SUMO.
        files: Name and content of it and of the files that it names.
        seed: Seed that the scenario was published with; that of the run is added to it.
        delta_steps: Steps of SUMO per time step.
        presimulation_steps: Time steps that SUMO simulates before the first one.
        n_steps: Time steps after which the scenario is over, if there are no agents.
        lateral_resolution: Width of SUMO's sublanes [m]; 0: vehicles keep to the middle of lanes.
        offset: Where the origin of the scenario lies in the coordinates of the net [m].
        lights: Ways across junctions for which SUMO shows what lights of the file show: SUMO's id of the light, the
            place of the way in its state, ids of the lights of the file, and whether vehicles yield to others on green.
    """

    config: str
    files: tuple[tuple[str, bytes], ...] = field(repr=False)
    seed: int = 0
    delta_steps: int = 1
    presimulation_steps: int = 0
    n_steps: int = 300
    lateral_resolution: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    lights: tuple[tuple[str, int, tuple[int, ...], bool], ...] = ()
