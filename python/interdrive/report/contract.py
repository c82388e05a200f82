"""What the header of a page holds. `frontend/contract.py` generates the TypeScript side (frontend/src/contract.ts)."""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict

#: Version of what is written into the page; the front end refuses others.
FORMAT = 2


class Entry(TypedDict):
    """A packed array, see report/packing.py."""

    type: Literal["u8", "i8", "i16", "i32", "f32"]
    shape: list[int]
    at: int
    unit: NotRequired[float]
    steps: NotRequired[bool]
    absent: NotRequired[int]
    spacing: NotRequired[int]
    point: NotRequired[list[int]]


class Missing(TypedDict):
    """What a reader might look for in vain, and why."""

    what: str
    text: str


class Participant(TypedDict):
    """One row of the states: what does not change.

    Traffic that is recorded or that SUMO drives has `agent` -1 and only what is required, the latter its `name` there.
    """

    id: int
    kind: str
    length: float
    width: float
    static: bool
    agent: int
    name: NotRequired[str]
    outlines: NotRequired[list[list[list[float]]]]
    color: NotRequired[str]
    planner: NotRequired[str]
    outcome: NotRequired[str]
    end: NotRequired[int]
    harm: NotRequired[float | None]
    ttc: NotRequired[str]
    reason: NotRequired[str]
    score: NotRequired[float | None]
    why: NotRequired[str]
    goal: NotRequired[list[list[list[float]]]]
    sensor_radius: NotRequired[float | None]
    occlusion: NotRequired[bool]


class Measure(TypedDict):
    """A criticality measure: the largest values drawn (cap) and told (horizon), and a line to compare with (level)."""

    name: str
    title: str
    unit: str
    grows: bool
    cap: float | None
    horizon: float | None
    level: float | None


class RunEvent(TypedDict):
    """A moment to jump to; `rows` are those of the states, the one it is about first."""

    step: int
    kind: str
    rows: list[int]
    text: str
    value: NotRequired[float]


class LaneTraffic(TypedDict):
    """Generated traffic of one lane as a whole, and by window: flows [1/h], speeds [m/s], vehicles that wait."""

    lane: int
    side: Literal["in", "out"]
    due: int | None
    vehicles: int
    flow: float
    speed: float | None
    wait: float | None
    queue: int | None
    flows: list[float]
    speeds: list[float | None]
    queues: list[int | None]


class Flows(TypedDict):
    """Generated traffic by lane; `edges` are those of the windows [s]."""

    edges: list[float]
    lanes: list[LaneTraffic]


class Shown(TypedDict):
    """What the map shows first [rad], [m]."""

    angle: float
    width: float
    height: float


class Info(TypedDict):
    """What the run was made with."""

    digest: str
    settings: dict[str, Any]
    versions: dict[str, str | None]
    platform: dict[str, Any]
    notes: list[str]
    seed: int | None


class RunHeader(TypedDict):
    """The page of a run; positions in its arrays are relative to `origin` [m]."""

    format: int
    kind: Literal["run"]
    name: str
    benchmark_id: str
    dt: float
    first_time_step: int
    n_steps: int
    view: Shown
    origin: tuple[float, float]
    participants: list[Participant]
    statuses: list[str]
    reasons: list[str]
    measures: list[Measure]
    events: list[RunEvent]
    missing: list[Missing]
    flows: NotRequired[Flows]
    info: Info
    arrays: dict[str, Entry]


class Part(TypedDict):
    """Agents with this traffic and choice of agents, of one category."""

    traffic: str
    agents: str
    category: str


class Cell(TypedDict):
    """A value as it is printed; strong: certainly better than all others of its column."""

    text: str
    strong: bool


class ComparedRow(TypedDict):
    """A planner; shares of outcomes in percent."""

    planner: str
    runs: str
    n_agents: int
    shares: dict[str, float]
    cells: list[Cell]


class Difference(TypedDict):
    """A metric of one planner minus that of another one; sure: it may be called a difference."""

    metric: str
    text: str
    interval: str
    verdict: str
    sure: bool
    value: float
    low: float | None
    high: float | None
    extent: float


class Pair(TypedDict):
    """Two planners."""

    name: str
    differences: list[Difference]


class Compared(TypedDict):
    """What is compared: runs with this traffic and agents, of one category or "all"."""

    traffic: str
    agents: str
    category: str
    title: str
    size: str
    headings: list[str]
    rows: list[ComparedRow]
    pairs: list[Pair]
    note: str


class Drawn(TypedDict):
    """A column whose distribution is drawn; values beyond the cap do not matter."""

    name: str
    title: str
    unit: str
    cap: float | None


class BatchRun(TypedDict):
    """A run of a batch.

    `agent` is under test alone, `damage` says why a kept run has no page, `command` does a finished run without a page
    again (null if one command cannot).
    """

    scenario: str
    category: str
    variant: str
    traffic: str
    agents: str
    seed: int
    status: str
    error: str
    n_agents: int
    agent: int | None
    outcomes: dict[str, int]
    ttc_min: float | None
    ttc: str
    page: str | None
    damage: str
    command: NotRequired[str | None]


class BatchHeader(TypedDict):
    """The page of a batch."""

    format: int
    kind: Literal["batch"]
    name: str
    version: list[str]
    variants: list[str]
    parts: list[Part]
    compared: list[Compared]
    caveats: list[str]
    drawn: list[Drawn]
    runs: list[BatchRun]
    missing: list[Missing]
    arrays: dict[str, Entry]
