"""CommonRoad documents read by commonroad-io: a second reader, which has no line in common with that of the core.

What commonroad-io refuses although it means something is completed, and what it loses is read beside it.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, ElementTree

import numpy as np

from commonroad_io import document
from commonroad_io.completion import completed_document
from commonroad_io.references import dangling_in_file
from interdrive.files.convert import converted
from interdrive.files.document import parse
from interdrive.files.elements import SignName
from interdrive.files.facts import Facts
from interdrive.files.read import quiet

if TYPE_CHECKING:
    from interdrive.scenario import Scenario

_COLUMNS = {"orientation": "orientation", "velocity": "velocity", "acceleration": "acceleration", "yawRate": "yaw_rate"}


def read_by_commonroad_io(data: bytes, file: str) -> Scenario:
    """The scenario of a document, without repairs.

    Raises:
        InputError: The document cannot be used.
    """
    with quiet(file):
        root = parse(data, file)
        dangling = dangling_in_file(root)
        document.check(root, file)
        lost = document.facts(root, file)
        notes = completed_document(root, file)
        scenario, problems = _opened(root, data)
        _add_lost(scenario, problems, lost)
        facts = Facts(benchmark_id=lost.benchmark_id, version=lost.version, dangling=dangling, notes=notes)
        return converted(scenario, problems, file=file, path=None, sha256="", facts=facts)


def _opened(root: Element, data: bytes) -> tuple[Any, dict[int, Any]]:
    from commonroad.common.reader.file_reader_xml import XMLFileReader

    class Reader(XMLFileReader):
        """Reads the checked document."""

        def _parse_file(self) -> None:
            self._tree = ElementTree(root)

    scenario, problems = Reader(data).open(lanelet_assignment=False)
    return scenario, problems.planning_problem_dict


def _add_lost(scenario: Any, problems: dict[int, Any], lost: document.Facts) -> None:
    moving = {obstacle.obstacle_id for obstacle in scenario.dynamic_obstacles}
    for obstacle in (*scenario.static_obstacles, *scenario.dynamic_obstacles):
        number = obstacle.obstacle_id
        _forget(obstacle.initial_state, lost.stated[number])
        if number in lost.footprints:
            obstacle._obstacle_shape = lost.footprints[number]
        if number in lost.trajectories and number in moving:
            steps, rows = zip(*lost.trajectories[number], strict=True)
            table = np.array(steps, dtype=np.int64), np.array(rows, dtype=np.float64)
            obstacle._prediction = SimpleNamespace(trajectory=SimpleNamespace(state_list=(), table=table))
    for number, problem in problems.items():
        _forget(problem.initial_state, lost.stated_by_problem[number])
    for light in scenario.lanelet_network.traffic_lights:
        if light.traffic_light_id in lost.unplaced_lights:
            light._position = None
    for sign in scenario.lanelet_network.traffic_signs:
        codes = lost.signs.get(sign.traffic_sign_id)
        if codes is not None:
            for element, code in zip(sign.traffic_sign_elements, codes, strict=False):
                element._traffic_sign_element_id = SignName(element.traffic_sign_element_id.name, code)


def _forget(state: Any, stated: frozenset[str]) -> None:
    """What a state does not state, which commonroad-io takes for 0."""
    for tag, name in _COLUMNS.items():
        if tag not in stated:
            setattr(state, name, None)
