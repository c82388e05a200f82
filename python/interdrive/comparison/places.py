"""What is drawn together in intervals: agents of one place, one file, or each alone."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

#: What may be drawn together.
GROUPS = ("place", "file", "agent")

#: The map in the name of a CommonRoad file: `DEU_Muc-12` of `DEU_Muc-12_3_T-1`.
_MAP = re.compile(r"(?P<road>[A-Z]{3}_[A-Za-z0-9]+)-(?P<map>\d+)_\d+(_\d+)*(_[A-Z](-\d+)*)?$")

#: Sites whose maps were cut several times, so that all numbers are one stretch of road.
_SITES = ("USA_US101", "USA_Lanker", "USA_Peach", "DEU_A9")


def place_of(scenario: str) -> str:
    """The stretch of road of a CommonRoad file by its name; "" if the name does not tell."""
    found = _MAP.fullmatch(scenario.rpartition("/")[2])
    if found is None:
        return ""
    return found["road"] if found["road"] in _SITES else f"{found['road']}-{found['map']}"


def groups_of(rows: Mapping[str, Any], group: str) -> NDArray[np.object_]:
    """Per row with what it is drawn together, one of `GROUPS`; files whose names tell no place are one each."""
    files = rows["scenario_sha256"].astype(str)
    if group == "agent":
        each = zip(files.tolist(), rows["draw"].tolist(), rows["agent_id"].tolist(), strict=True)
        return np.array([f"{file} {draw} {agent}" for file, draw, agent in each], dtype=object)
    if group == "file":
        return np.array(files.tolist(), dtype=object)
    names = (place_of(str(name)) for name in rows["scenario"])
    return np.array([name or file for name, file in zip(names, files.tolist(), strict=True)], dtype=object)


def largest_share(groups: NDArray[np.object_]) -> tuple[str, float]:
    """The group with the most agents, and its share of them."""
    if not len(groups):
        return "", 0.0
    name, count = Counter(groups.tolist()).most_common(1)[0]
    return str(name), count / len(groups)
