"""Opens protobuf files of CommonRoad by commonroad-io, and makes them readable where they mean something it refuses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.files.content import content_of_file
from interdrive.scenario import limits

if TYPE_CHECKING:
    import os
    from collections.abc import Collection, Iterable, Mapping

    from interdrive.files.shapes import Foreign

#: Endings of protobuf files; all other files are read as XML.
PROTOBUF_ENDINGS = (".pb", ".proto", ".protobuf")
#: Intervals of headings from this width on [rad] hold every heading; decimals of 2 pi are cut in files.
_ANY_HEADING = 2.0 * math.pi - 1e-4
#: Countries whose list of signs in commonroad-io has no speed limit; its default list has one.
_WITHOUT_LIMIT = ("AUS",)
_DEFAULT_COUNTRY = "ZAM"


def open_protobuf(path: Path, data: bytes) -> tuple[Foreign, Foreign, tuple[str, ...]]:
    """Opens protobuf of the version of commonroad-io as its scenario and planning problem set, with notes."""
    try:
        from commonroad.common.file_reader import FileFormat  # noqa: PLC0415
    except ImportError:
        return _open_protobuf_parts(path)
    from commonroad.common.file_reader import CommonRoadFileReader  # noqa: PLC0415
    from commonroad.scenario_definition.protobuf_format.generated_scripts.commonroad_pb2 import (  # noqa: PLC0415
        CommonRoad,
    )

    _checked(CommonRoad(), data, path)
    return (*CommonRoadFileReader(data, file_format=FileFormat.PROTOBUF).open(), ())


def _open_protobuf_parts(path: Path) -> tuple[Foreign, Foreign, tuple[str, ...]]:
    """The same for commonroad-io from 2026.1 on, with separate files for map, traffic and planning problems."""
    traffic_file, problem_file, road_file = _protobuf_parts(path)
    for part, meaning in ((traffic_file, "traffic"), (road_file, "map")):
        if not part.is_file():
            raise InputError(f"{path}: the {meaning} file {part.name} is not beside it; put it there or convert to XML")
    from commonroad.common.file_reader import CommonRoadFileReader  # noqa: PLC0415
    from commonroad.common.protobuf.dynamic.commonroad_dynamic_pb2 import CommonRoadDynamic  # noqa: PLC0415
    from commonroad.common.protobuf.map.commonroad_map_pb2 import CommonRoadMap  # noqa: PLC0415
    from commonroad.common.protobuf.scenario.commonroad_scenario_pb2 import CommonRoadScenario  # noqa: PLC0415
    from commonroad.scenario.traffic_sign import TrafficSignIDCountries  # noqa: PLC0415

    traffic = _checked(CommonRoadDynamic(), content_of_file(traffic_file), traffic_file)
    roads = _checked(CommonRoadMap(), content_of_file(road_file), road_file)
    problems = CommonRoadScenario()
    if problem_file.is_file():
        _checked(problems, content_of_file(problem_file), problem_file)
    signs = {country: names.__members__.keys() for country, names in TrafficSignIDCountries.items()}
    notes = completed_messages(roads, traffic, problems, signs, str(problem_file))
    reader = CommonRoadFileReader(
        filename_map=roads.SerializeToString(),
        filename_dynamic=traffic.SerializeToString(),
        filename_scenario=problems.SerializePartialToString(),
    )
    if problem_file.is_file():
        scenario, problem_set, _cooperative = reader.open_all()
        return scenario, problem_set, notes
    return reader.open_map_dynamic(), None, notes


def _checked(message: Foreign, data: bytes, path: Path) -> Foreign:
    message.MergeFromString(data)
    check_message(message, str(path))
    missing = message.FindInitializationErrors()
    if missing:
        raise InputError(f"{path}: lacks {missing[0]}; add it")
    return message


def _protobuf_parts(path: Path) -> tuple[Path, Path, Path]:
    """The expected paths of traffic, planning problems and map of a protobuf file."""
    name = path.stem.removesuffix("-SC")
    return (
        path.with_name(name + path.suffix),
        path.with_name(f"{name}-SC{path.suffix}"),
        path.with_name("_".join(name.split("_")[:2]) + path.suffix),
    )


def scenario_parts(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The files beside `path` that `read_scenario` may open with it, in a fixed order; XML files have none."""
    path = Path(path)
    if path.suffix.lower() not in PROTOBUF_ENDINGS:
        return ()
    return tuple(part for part in _protobuf_parts(path) if part != path and part.is_file())


def completed_messages(
    roads: Foreign, traffic: Foreign, problems: Foreign, signs: Mapping[str, Collection[str]], file: str
) -> tuple[str, ...]:
    """Changes the three messages of a scenario so that commonroad-io reads them.

    An interval of a full turn or more as a heading states none, so it is left out. Where commonroad-io knows no speed
    limit in a country, it is told the default country. A sign that is not in the list of its country is read as an
    unknown sign.

    Args:
        roads: Message of the map, changed in place, as are the others.
        traffic: Message of the traffic.
        problems: Message of the planning problems; may be empty.
        signs: Names of the signs of each country that commonroad-io knows.
        file: Name for messages.

    Returns:
        Notes on cycles of traffic lights that do not exist, which are left out.

    Raises:
        InputError: The start of a planning problem has any heading.
    """
    place = roads.map_meta_information.map_id
    if place.country_id not in signs or place.country_id in _WITHOUT_LIMIT:
        place.country_id = _DEFAULT_COUNTRY
    known = signs[place.country_id]
    for sign in roads.traffic_signs:
        for element in sign.traffic_sign_elements:
            names = element.DESCRIPTOR.fields_by_name["element_id"].enum_type
            if names.values_by_number[element.element_id].name not in known:
                element.element_id = names.values_by_name["UNKNOWN"].number
    # Values that signs show for a time are never read.
    traffic.ClearField("traffic_sign_value")
    for problem in problems.planning_problems:
        if _is_any_angle(problem.initial_state.orientation):
            raise InputError(
                f"{file}: planning problem {problem.planning_problem_id} starts with any heading; state one"
            )
        _drop_any_headings(goal.state for goal in problem.goal_states)
    for obstacle in (*traffic.static_obstacles, *traffic.dynamic_obstacles):
        _drop_any_headings((obstacle.initial_state,))
    for obstacle in traffic.dynamic_obstacles:
        _drop_any_headings(obstacle.trajectory_prediction.trajectory.states)
    lights = {light.traffic_light_id for light in roads.traffic_lights}
    lost = [cycle for cycle in traffic.traffic_light_cycle if cycle.traffic_light_id not in lights]
    for cycle in lost:
        traffic.traffic_light_cycle.remove(cycle)
    return tuple(
        f"a cycle is for traffic light {number}, which does not exist"
        for number in sorted({cycle.traffic_light_id for cycle in lost})
    )


def _drop_any_headings(states: Iterable[Foreign]) -> None:
    for state in states:
        if _is_any_angle(state.orientation):
            state.ClearField("orientation")


def _is_any_angle(angle: Foreign) -> bool:
    return bool(angle.interval.end - angle.interval.start >= _ANY_HEADING)


def check_message(message: Foreign, file: str) -> None:
    """Refuses angles in a protobuf message for which commonroad-io would take for ever.

    All other values are checked after the conversion to arrays.

    Args:
        message: Message of any version of the format.
        file: Name of the file that it comes from.

    Raises:
        InputError: One line that names file and field.
    """
    waiting: list[tuple[Foreign, str, bool]] = [(message, "", False)]
    while waiting:
        owner, name, turns = waiting.pop()
        for field, value in owner.ListFields():
            is_angle = turns or "orientation" in field.name or "angle" in field.name
            is_one = isinstance(value, float | int | str | bytes) or hasattr(value, "ListFields")
            values = [value] if is_one else value
            for one in values:
                if hasattr(one, "ListFields"):
                    kind = field.name.removesuffix("s")
                    number = getattr(one, f"{kind}_id", None)
                    inner = name if number is None else f"{kind.replace('_', ' ')} {number}"
                    waiting.append((one, inner, is_angle))
                elif is_angle and isinstance(one, float) and abs(one) > limits.LARGEST_ANGLE:
                    raise InputError(
                        f"{file}: {name or owner.DESCRIPTOR.name} has the orientation {one:g}; give it in radians"
                    )
