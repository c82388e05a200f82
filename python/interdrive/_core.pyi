"""The native core: handles, arrays, errors. SI units, radians, world frame; arrays are read-only."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from interdrive.native_settings import (
    ConstantVelocity,
    CoreStepSettings,
    Kinematic,
    LaneFollowing,
    MeasureSettings,
    ObservationSettings,
    RewardWeights,
    RoadSettings,
    RulesSettings,
    V2xSettings,
    ViewSettings,
)

_Floats = NDArray[np.float64]
_Singles = NDArray[np.float32]
_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]
_Interval = tuple[float, float]

__all__ = [
    "CODES",
    "CREEPING_SPEED",
    "DEEPEST",
    "DESIGN_WIDTH",
    "EXPECTED_DECELERATION",
    "GOING_SIGNALS",
    "JUDGED_STANDSTILL_SPEED",
    "LARGEST_ACCELERATION",
    "LARGEST_ANGLE",
    "LARGEST_COORDINATE",
    "LARGEST_DT",
    "LARGEST_GOAL_TIME_STEP",
    "LARGEST_ID",
    "LARGEST_TIME_STEP",
    "LARGEST_VELOCITY",
    "LARGEST_YAW_RATE",
    "MOST_LANELETS",
    "MOST_OBSTACLES",
    "MOST_POINTS",
    "MOST_POINTS_OF_A_LANELET",
    "MOST_PROBLEMS",
    "MOST_STATES",
    "NEURAL",
    "PLAN_POINTS_MAX",
    "RANK_WITHOUT_SIGN",
    "RASTER",
    "REACH",
    "REACH_TIME",
    "REWARDS",
    "SMALLEST_DT",
    "STANDSTILL_SPEED",
    "STOP_RANK",
    "STOP_REACH",
    "Agent",
    "Barriers",
    "Ego",
    "Goal",
    "NeuralInputs",
    "NeuralNetwork",
    "Participants",
    "Planner",
    "Predictions",
    "Predictor",
    "RoadNetwork",
    "Route",
    "Scenario",
    "Scene",
    "Shape",
    "Stage",
    "Step",
    "Traffic",
    "Vehicle",
    "View",
    "World",
    "Worlds",
    "__version__",
    "boundary_harm",
    "check_settings",
    "collision_harm",
    "could_stop",
    "crossing_lanelets",
    "drive_cut_ins",
    "drive_cut_outs",
    "drive_followings",
    "evaluate_criticality",
    "exposure",
    "follow_path",
    "leaves_road",
    "minimal_stopping_distance",
    "observation_blocks",
    "observation_layout",
    "overlapping_lanelets",
    "participant_mass",
    "proportion_of_stopping_distance",
    "read_commonroad",
    "required_acceleration",
    "required_lateral_acceleration",
    "rss_lateral",
    "rss_longitudinal",
    "settings_tables",
    "start_conflict",
    "steps_at_most",
    "time_headway",
    "time_to_collision",
]
__version__: str
#: Most points of a plan from outside the core.
PLAN_POINTS_MAX: int
#: Names of the codes in arrays, by their position: participants ("kind"), outcomes, signals, areas and others.
CODES: dict[str, list[str]]
#: How vehicles drive, as in `conduct.rs`: an agent stands below the first speed, and stood
#: below the second when its run is judged [m/s].
STANDSTILL_SPEED: float
JUDGED_STANDSTILL_SPEED: float
#: Up to this speed [m/s] the yaw rate says nothing about the steering angle.
CREEPING_SPEED: float
#: Braking that is expected of every vehicle [m/s²].
EXPECTED_DECELERATION: float
#: What a stop sign and a way without a sign are worth where ways meet; the greater rank goes first.
STOP_RANK: int
RANK_WITHOUT_SIGN: int
#: Codes of the signals that hold nobody.
GOING_SIGNALS: list[int]
#: Stops count so far before the line of a sign [m].
STOP_REACH: float
DEEPEST: int
LARGEST_GOAL_TIME_STEP: int
LARGEST_ID: int
LARGEST_TIME_STEP: int
MOST_LANELETS: int
MOST_OBSTACLES: int
MOST_POINTS: int
MOST_POINTS_OF_A_LANELET: int
MOST_PROBLEMS: int
MOST_STATES: int
LARGEST_ACCELERATION: float
LARGEST_ANGLE: float
LARGEST_COORDINATE: float
LARGEST_DT: float
LARGEST_VELOCITY: float
LARGEST_YAW_RATE: float
SMALLEST_DT: float
#: Orders are asked from `REACH` [m] or `REACH_TIME` [s] before a junction on; its areas are for vehicles of
#: `DESIGN_WIDTH` [m].
DESIGN_WIDTH: float
REACH: float
REACH_TIME: float

#: The input of the neural predictor: `version`; `knots` [s]; `agent`, `neighbours`, `paths`: name, scale and sign in a
#: mirrored world of every feature; `slots`: names of the paths; `path_mirror_columns`, `mirror_slots`: their order in a
#: mirrored world.
NEURAL: dict[str, Any]
RASTER: tuple[int, int, int]
REWARDS: list[str]

@final
class Shape:
    @staticmethod
    def rectangle(length: float, width: float, x: float = 0.0, y: float = 0.0, orientation: float = 0.0) -> Shape: ...
    @staticmethod
    def circle(radius: float, x: float = 0.0, y: float = 0.0) -> Shape: ...
    @staticmethod
    def polygon(vertices: _Floats) -> Shape: ...
    @staticmethod
    def group(members: Sequence[Shape]) -> Shape: ...
    @property
    def extent(self) -> tuple[float, float]: ...
    def outline(self) -> list[_Floats]: ...
    def distance(
        self, pose: tuple[float, float, float], other: Shape, other_pose: tuple[float, float, float]
    ) -> float: ...

@final
class RoadNetwork:
    def __new__(
        cls,
        ids: Sequence[int],
        left: Sequence[_Floats],
        right: Sequence[_Floats],
        predecessors: Sequence[Sequence[int]],
        successors: Sequence[Sequence[int]],
        adjacent_left: Sequence[int],
        adjacent_left_same_direction: Sequence[bool],
        adjacent_right: Sequence[int],
        adjacent_right_same_direction: Sequence[bool],
        speed_limit: Sequence[float],
        users: Sequence[int],
        settings: RoadSettings,
        heights: Sequence[tuple[int, _Floats, _Floats]] = ...,
    ) -> RoadNetwork: ...
    def bounds(self) -> list[tuple[_Floats, bool]]: ...
    def on_lanelet(self, points: _Floats) -> _Bools: ...
    def on_road(self, points: _Floats) -> _Bools: ...
    def lanelets_at(self, x: float, y: float) -> list[int]: ...
    def admits(self, lanelet_id: int, kind: int) -> bool: ...
    def successors(self, lanelet_id: int) -> list[int]: ...
    def matching(
        self, x: float, y: float, orientation: float, tolerance: float, angle_max: float
    ) -> list[tuple[int, float, float, float]]: ...
    def lane_stretch(self, lanelet_id: int, s: float, before: float, after: float) -> list[_Floats]: ...
    @property
    def road_edges(self) -> _Floats: ...
    def are_apart(self, one: tuple[float, float, float], other: tuple[float, float, float]) -> bool: ...
    def lane_rules(self, x: _Floats, y: _Floats, orientation: _Floats) -> tuple[_Floats, _Floats]: ...
    def lanes_below(
        self, x: _Floats, y: _Floats, orientation: _Floats, angle_max: float
    ) -> tuple[_Ints, _Ints, _Floats, _Floats]: ...
    def covers(self, shape: Shape, x: float, y: float, orientation: float) -> bool: ...

@final
class Participants:
    def __new__(
        cls,
        ids: Sequence[int],
        shapes: Sequence[Shape],
        is_static: Sequence[bool],
        first_time_step: int,
        x: _Floats,
        y: _Floats,
        orientation: _Floats,
        velocity: _Floats,
        acceleration: _Floats,
        valid: _Bools,
        yaw_rate: _Floats | None = ...,
    ) -> Participants: ...

@final
class Scenario:
    def __new__(
        cls,
        dt: float,
        road: RoadNetwork,
        participants: Participants,
        kinds: Sequence[int],
        lights: Sequence[tuple[int, int, Sequence[tuple[int, int]]]] = ...,
        lines: Sequence[
            tuple[int, tuple[_Interval, _Interval], bool, Sequence[tuple[int, Sequence[int]]], Sequence[int]]
        ] = ...,
        priorities: tuple[
            Sequence[tuple[int, int]], Sequence[tuple[int, tuple[int, int, int]]], Sequence[int], bool, int, bool
        ]
        | None = ...,
        closed: tuple[Sequence[int], Sequence[int]] = ...,
        crosswalks: Sequence[int] = ...,
        overlaps: Sequence[tuple[int, int]] = ...,
        derived: Sequence[tuple[bool, bool]] = ...,
    ) -> Scenario: ...
    @property
    def dt(self) -> float: ...
    def junctions(self) -> dict[str, Any]: ...
    def scene(self, time_step: int, history_steps: int = 30) -> Scene: ...

@final
class Goal:
    def __new__(
        cls,
        states: Sequence[tuple[Sequence[Shape], tuple[int, int], _Interval | None, _Interval | None]],
        pace: float | None = None,
    ) -> Goal: ...
    @property
    def states(self) -> list[tuple[list[_Floats], tuple[int, int], _Interval | None, _Interval | None]]: ...
    def is_met(self, x: float, y: float, orientation: float, velocity: float, time_step: int) -> tuple[bool, bool]: ...

@final
class Vehicle:
    def __new__(
        cls,
        kind: int,
        length: float,
        width: float,
        *,
        acceleration_max: float | None = None,
        velocity_max: float | None = None,
        steering_angle_max: float | None = None,
        steering_rate_max: float | None = None,
        lateral_acceleration_max: float | None = None,
    ) -> Vehicle: ...
    @staticmethod
    def of_type(number: int, *, velocity_max: float | None = None) -> Vehicle: ...
    @property
    def length(self) -> float: ...
    @property
    def width(self) -> float: ...
    @property
    def wheelbase(self) -> float: ...
    @property
    def rear_axle_to_center(self) -> float: ...
    @property
    def acceleration_max(self) -> float: ...
    @property
    def velocity_switch(self) -> float: ...
    @property
    def velocity_max(self) -> float: ...
    @property
    def steering_angle_max(self) -> float: ...
    @property
    def steering_rate_max(self) -> float: ...
    @property
    def lateral_acceleration_max(self) -> float: ...
    @property
    def curvature_max(self) -> float: ...

@final
class Route:
    @staticmethod
    def find(
        road: RoadNetwork, x: float, y: float, orientation: float, velocity: float, goal: Goal, user: int = ...
    ) -> Route: ...
    @staticmethod
    def along(
        road: RoadNetwork,
        x: float,
        y: float,
        orientation: float,
        velocity: float,
        track: _Floats,
        *,
        keeps_lane: bool,
        length: float,
        user: int = ...,
    ) -> Route: ...
    @staticmethod
    def through(
        road: RoadNetwork,
        x: float,
        y: float,
        orientation: float,
        velocity: float,
        lanelet_ids: Sequence[int],
        goal: Goal,
        user: int = ...,
    ) -> Route: ...
    @property
    def lanelet_ids(self) -> list[int]: ...
    @property
    def reference_path(self) -> _Floats: ...
    @property
    def reference_orientation(self) -> _Floats: ...
    @property
    def reference_curvature(self) -> _Floats: ...
    @property
    def length(self) -> float: ...
    @property
    def start_s(self) -> float: ...
    @property
    def goal_entry_s(self) -> float: ...
    @property
    def goal_exit_s(self) -> float: ...
    @property
    def lane_changes(self) -> int: ...
    def first_state(
        self,
        vehicle: Vehicle,
        state: tuple[float, float, float, float, float, float],
        past: Sequence[tuple[float, float]],
        dt: float,
    ) -> tuple[float, float]: ...
    def project(self, x: _Floats, y: _Floats) -> tuple[_Floats, _Floats]: ...

@final
class Planner:
    """A native planner with its settings.

    Raises:
        InputError: No planner has this name, or a setting is outside its range.
    """

    def __new__(cls, name: str, record: object) -> Planner: ...
    @staticmethod
    def policy(
        layers: Sequence[tuple[str, _Singles, _Singles]],
        activation: str,
        actions: tuple[str, object, Sequence[int]],
        observation: ObservationSettings,
    ) -> Planner: ...

@final
class Scene:
    @property
    def road(self) -> RoadNetwork: ...
    @property
    def observed_velocity(self) -> _Floats: ...
    @property
    def is_standing(self) -> _Bools: ...
    def parts(self) -> tuple[Any, ...]: ...
    @property
    def time_step(self) -> int: ...
    @property
    def dt(self) -> float: ...
    @property
    def ids(self) -> _Ints: ...
    @property
    def kinds(self) -> _Ints: ...
    @property
    def is_static(self) -> _Bools: ...
    @property
    def length(self) -> _Floats: ...
    @property
    def width(self) -> _Floats: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def y(self) -> _Floats: ...
    @property
    def orientation(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def acceleration(self) -> _Floats: ...
    @property
    def yaw_rate(self) -> _Floats: ...
    @property
    def turn(self) -> _Floats: ...
    @property
    def valid(self) -> _Bools: ...

@final
class NeuralInputs:
    """What the neural predictor is told about the vehicles of a scene (n rows, ascending ids; P slots for paths).

    Rows are the vehicles that are present, can move and do not drive backwards. Path coordinates are arc
    length `s` from where the vehicle is now and offset `d` to the left [m].
    """

    def __new__(cls, scene: Scene) -> NeuralInputs: ...
    @property
    def ids(self) -> _Ints: ...
    @property
    def agent(self) -> _Singles:
        """Past and present, shape (n, features of `NEURAL["agent"]`)."""
    @property
    def neighbours(self) -> _Singles:
        """Nearest first, shape (n, 8, features of `NEURAL["neighbours"]`); zero where there is none."""
    @property
    def paths(self) -> _Singles:
        """Shape (n, P, features of `NEURAL["paths"]`); zero where a slot is empty."""
    @property
    def path_valid(self) -> _Bools:
        """Shape (n, P)."""
    @property
    def standing(self) -> _Bools:
        """Has not moved for half a second, or for all that is known; shape (n,)."""
    @property
    def velocity(self) -> _Singles:
        """Speed along the heading as observed [m/s], not negative; shape (n,)."""
    @property
    def offset(self) -> _Singles:
        """Offset from each path now [m], nan where a slot is empty; shape (n, P)."""
    @property
    def slope(self) -> _Singles:
        """Tangent of the heading error, bounded, nan where a slot is empty; shape (n, P)."""
    @property
    def settling(self) -> _Singles:
        """Distance within which the offset is given up [m], nan where a slot is empty; shape (n, P)."""
    def targets(self, future: _Floats) -> _Singles:
        """Path coordinates of positions at the knots [m].

        Args:
            future: World positions 0.5, 1.0 ... 3.0 s from now [m], shape (n, 6, 2), nan where unknown.

        Returns:
            (s, d) on every path, shape (n, P, 6, 2); nan where unknown, more than 20 m beside the path or without a
            foot on it.
        """
    def to_world(self, s: _Floats, d: _Floats) -> _Floats:
        """World position [m] and heading of the path [rad] at path coordinates.

        Args:
            s: Arc lengths [m], shape (n, P, points).
            d: Offsets [m], same shape.

        Returns:
            x, y and heading, shape (n, P, points, 3); nan where a slot is empty.
        """

@final
class NeuralNetwork:
    """The network of the neural predictor.

    Raises:
        InputError: A tensor is missing, unknown, of a wrong shape, or has impossible values.
    """

    def __new__(cls, tensors: dict[str, _Singles]) -> NeuralNetwork: ...
    def forward(self, agent: _Singles, neighbours: _Singles, paths: _Singles, path_valid: _Bools) -> _Singles:
        """Raw outputs for features as `NeuralInputs` has them.

        Returns:
            Shape (n, P, modes, 25): of every mode its logit, then of every knot the speed and the lateral speed [m/s]
            besides those expected, and the logarithms of the growth of the standard deviations along and across the
            path [m/s]; zero where a slot is empty.

        Raises:
            InputError: An array of a wrong shape.
        """

@final
class View:
    @property
    def ego(self) -> Ego: ...
    def outlines(self, id: int) -> list[_Floats]: ...
    def check_plan(
        self,
        x: _Floats,
        y: _Floats,
        orientation: _Floats,
        velocity: _Floats,
        acceleration: _Floats | None = None,
        yaw_rate: _Floats | None = None,
    ) -> None: ...
    def on_road(self, x: _Floats, y: _Floats, orientation: _Floats) -> bool: ...
    def first_contact(
        self,
        x: _Floats,
        y: _Floats,
        orientation: _Floats,
        predictions: Predictions,
        margin_length: float = 0.0,
        margin_width: float = 0.0,
    ) -> tuple[int, int] | None: ...
    @property
    def time_step(self) -> int: ...
    @property
    def dt(self) -> float: ...
    @property
    def ids(self) -> _Ints: ...
    @property
    def kinds(self) -> _Ints: ...
    @property
    def is_static(self) -> _Bools: ...
    @property
    def length(self) -> _Floats: ...
    @property
    def width(self) -> _Floats: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def y(self) -> _Floats: ...
    @property
    def orientation(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def acceleration(self) -> _Floats: ...
    @property
    def yaw_rate(self) -> _Floats: ...
    @property
    def turn(self) -> _Floats: ...
    @property
    def valid(self) -> _Bools: ...
    @property
    def via(self) -> _Ints: ...
    @property
    def age(self) -> _Floats: ...

@final
class Barriers:
    def __len__(self) -> int: ...
    @property
    def s(self) -> _Floats: ...
    @property
    def until(self) -> _Floats: ...
    @property
    def reason(self) -> tuple[str, ...]: ...
    @property
    def by_id(self) -> _Ints: ...

@final
class Ego:
    @property
    def id(self) -> int: ...
    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def orientation(self) -> float: ...
    @property
    def velocity(self) -> float: ...
    @property
    def acceleration(self) -> float: ...
    @property
    def yaw_rate(self) -> float: ...
    @property
    def state(self) -> _Floats: ...
    @property
    def vehicle(self) -> Vehicle: ...
    @property
    def goal(self) -> Goal: ...
    @property
    def goal_time_step(self) -> tuple[int, int]: ...
    @property
    def driver(self) -> Mapping[str, float]: ...
    @property
    def route(self) -> Route: ...
    @property
    def s(self) -> float: ...
    @property
    def stop_s(self) -> float: ...
    @property
    def stop_release(self) -> float: ...
    @property
    def stop_by(self) -> int | None: ...
    @property
    def barriers(self) -> Barriers: ...
    @property
    def _progress(self) -> tuple[float, float, list[tuple[float, float, int, int | None]]]: ...
    @property
    def speed_limit(self) -> _Floats: ...
    @property
    def road_edges(self) -> _Floats: ...

@final
class Agent:
    def __new__(
        cls,
        id: int,
        kind: int,
        shape: Shape,
        vehicle: Vehicle,
        initial_state: tuple[float, float, float, float, float, float],
        start_time_step: int,
        goal: Goal,
        route: Route,
        planner: Planner | None,
        view: ViewSettings,
        rules: RulesSettings,
        v2x: bool | None = None,
        replays_before: bool = False,
        queue: tuple[int, int] | None = None,
    ) -> Agent: ...

@final
class Predictor:
    @staticmethod
    def constant_velocity(record: ConstantVelocity) -> Predictor: ...
    @staticmethod
    def lane_following(record: LaneFollowing) -> Predictor: ...
    @staticmethod
    def ground_truth(recorded: Scenario, agents: LaneFollowing) -> Predictor: ...
    @staticmethod
    def neural(network: NeuralNetwork, modes_max: int) -> Predictor: ...

@final
class Predictions:
    def __new__(
        cls,
        time_step: int,
        ids: _Ints,
        probability: _Floats,
        x: _Floats,
        y: _Floats,
        orientation: _Floats,
        velocity: _Floats,
        covariance: _Floats,
        valid: _Bools,
    ) -> Predictions: ...
    def of(self, ids: _Ints) -> Predictions: ...
    def seen_by(self, view: View) -> Predictions: ...
    def known(self, id: int) -> list[tuple[Any, ...]] | None: ...
    def plan_ages(self) -> tuple[_Floats, int]: ...
    def received(self) -> tuple[Predictions, _Ints, _Floats] | None: ...
    def completed(self, scene: Scene) -> Predictions: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...
    @property
    def time_step(self) -> int: ...
    @property
    def ids(self) -> _Ints: ...
    @property
    def probability(self) -> _Floats: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def y(self) -> _Floats: ...
    @property
    def orientation(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def covariance(self) -> _Floats: ...
    @property
    def valid(self) -> _Bools: ...

@final
class Step:
    @property
    def scene(self) -> Scene: ...
    @property
    def predictions(self) -> Predictions: ...
    @property
    def ids(self) -> _Ints: ...
    @property
    def status(self) -> _Ints: ...
    @property
    def cost(self) -> _Floats: ...
    @property
    def missing(self) -> list[int]: ...
    @property
    def plan_seconds(self) -> _Floats: ...
    @property
    def seconds(self) -> list[float]: ...
    def mark(self) -> None: ...
    def set(
        self,
        view: View,
        x: _Floats,
        y: _Floats,
        orientation: _Floats,
        velocity: _Floats,
        acceleration: _Floats | None = None,
        yaw_rate: _Floats | None = None,
        *,
        slides: bool = False,
    ) -> None: ...
    def fail(self, id: int, message: str) -> None: ...

_Outside: TypeAlias = tuple[Sequence[tuple[int, int, float, float]], Sequence[int], _Floats, Sequence[int]]

@final
class World:
    def __new__(
        cls,
        scenario: Scenario,
        agents: Sequence[Agent],
        step: CoreStepSettings,
        *,
        threads: int,
        record_views: bool = False,
        v2x: V2xSettings | None = None,
        seed: int = 0,
        messages: str = "none",
        profile: bool = False,
        steps_without_agents: int = 0,
    ) -> World: ...
    @property
    def time_step(self) -> int: ...
    @property
    def is_done(self) -> bool: ...
    @property
    def driving(self) -> list[int]: ...
    @property
    def last_time_step(self) -> int | None: ...
    @property
    def entered_in_contact(self) -> list[tuple[int, int]]: ...
    @property
    def native_seconds(self) -> float: ...
    def scene(self) -> Scene: ...
    def view(
        self,
        scene: Scene,
        id: int,
        told: tuple[float, float, list[tuple[float, float, int, int | None]]] | None = None,
        known: Sequence[tuple[Any, ...]] | None = None,
        driver: dict[str, float] | None = None,
    ) -> View: ...
    def scene_from(self, parts: tuple[Any, ...]) -> Scene: ...
    def predict(self, predictor: Predictor, scene: Scene, n_steps: int) -> Predictions: ...
    def observe(self) -> Step: ...
    def plan(self, step: Step, forecast: Predictor | Predictions, n_steps: int = 0) -> None: ...
    def replace_driver(self, agent_id: int, name: str) -> None: ...
    def place_outside(self, parts: _Outside) -> None: ...
    def next_of(self, step: Step) -> tuple[list[int], _Floats]: ...
    def advance(self, step: Step, driven: _Outside | None = None) -> None: ...
    def drive_on(self, id: int) -> None: ...
    @property
    def equipped(self) -> list[int]: ...
    @property
    def obeying(self) -> list[int]: ...
    def messages(self) -> dict[str, Any] | None: ...
    def agreements(self) -> dict[str, Any]: ...
    def candidates(self, id: int, step: Step) -> dict[str, Any] | None: ...
    def outcomes(self) -> dict[str, Any]: ...
    def states(self) -> dict[str, Any]: ...
    def sightings(self) -> dict[str, Any]: ...
    def waits(self) -> dict[str, Any]: ...
    def entries(self) -> dict[str, Any]: ...
    def plans(self) -> dict[str, Any]: ...
    def hand_over_plans(self) -> dict[str, Any]: ...
    def take_recorded(self, end: bool) -> tuple[dict[str, Any], dict[str, Any]]: ...
    def participants(self) -> dict[str, Any]: ...

@final
class Stage:
    """A scenario with the vehicles that can learn, each with the planner that drives it if it does not.

    Raises:
        InputError: An id occurs twice, or a planner needs a recording that is not there.
    """

    def __new__(
        cls,
        scenario: Scenario,
        agents: Sequence[Agent],
        planners: Sequence[Planner | None],
        learning: Planner | None = None,
    ) -> Stage: ...
    @property
    def ids(self) -> list[int]: ...
    def eligible(self, time_step: int, rest: int) -> list[int]: ...
    def later(self, time_step: int, rest: int) -> list[int]: ...
    def recorded_actions(self, position: int, model: Kinematic) -> tuple[_Singles, _Bools]: ...

@final
class Worlds:
    """Many worlds in which agents learn; they write into the arrays that are bound.

    Raises:
        InputError: Impossible settings.
    """

    def __new__(
        cls,
        stages: Sequence[Stage],
        *,
        actions: tuple[str, object, Sequence[int]],
        observation: ObservationSettings,
        reward: RewardWeights,
        step: CoreStepSettings,
        predictor: Predictor,
        horizon: float,
        decision_seconds: float,
        max_seconds: float,
        time_limit_terminates: bool,
        autoreset: str,
        record: bool,
        threads: int,
        num_worlds: int,
        slots: int,
    ) -> Worlds: ...
    @property
    def num_rows(self) -> int: ...
    @property
    def num_observations(self) -> int: ...
    @property
    def observed(self) -> list[str]: ...
    @property
    def hungry(self) -> list[int]: ...
    def copy(self) -> Worlds: ...
    def bind(
        self,
        *,
        actions: NDArray[Any],
        observations: _Singles,
        rewards: _Singles,
        terminals: _Bools,
        truncations: _Bools,
        masks: _Bools,
        outcomes: NDArray[np.int8],
        agent_ids: _Ints,
        components: _Singles | None = None,
        raster: NDArray[np.uint8] | None = None,
        final_observations: _Singles | None = None,
        final_raster: NDArray[np.uint8] | None = None,
    ) -> None: ...
    def queue(
        self,
        world: int,
        stage: int,
        first_time_step: int,
        learners: Sequence[int],
        planners: Sequence[tuple[int, Planner]] = ...,
        generated: Sequence[Agent] = ...,
    ) -> None: ...
    def reset(self, worlds: Sequence[bool]) -> None: ...
    def step(self) -> None: ...
    def set_rewards(self, reward: RewardWeights) -> None: ...
    def set_stages(self, stages: Sequence[Stage]) -> None: ...
    def ended(
        self,
    ) -> list[
        tuple[tuple[int, int, int, int, bool, int, bool, float], tuple[int, float, float, float, float, list[float]]]
    ]: ...
    def outcomes(self, world: int) -> dict[str, Any]: ...
    def states(self, world: int) -> dict[str, Any]: ...
    def plans(self, world: int) -> dict[str, Any]: ...

def read_commonroad(text: str) -> dict[str, Any]:
    """The elements of a CommonRoad document, by the names of `interdrive.files.elements`."""

def check_settings(name: str, given: object) -> None:
    """Checks the fields of a record by the core's table of this name.

    Raises:
        InputError: A setting is outside its range; the location is its dotted name.
    """

def settings_tables() -> list[dict[str, Any]]:
    """The core's tables of settings: name, text, and the fields with name, unit, text, range and default."""

def could_stop(velocity: float, distance: float) -> bool:
    """Whether a vehicle could stop comfortably within a distance [m] from a speed [m/s]."""

def steps_at_most(step: CoreStepSettings, n_recorded: int, agents: list[tuple[int, int]]) -> int:
    """Number of time steps after which a run with these settings ends.

    For so many recorded time steps, and agents that start and whose goals end at these time steps.
    """

def observation_layout(
    settings: ObservationSettings, planner: Sequence[str] = ...
) -> list[tuple[str, int, str, str, str]]:
    """Every number of an observation in its order: block, row within it, name, unit, and what it is divided by."""

def observation_blocks(settings: ObservationSettings, planner: Sequence[str] = ...) -> list[tuple[str, int, int]]:
    """Name, rows (0: one vector) and columns of the blocks of an observation in their order."""

def time_headway(headway: _Floats, velocity: _Floats) -> _Floats: ...
def time_to_collision(headway: _Floats, velocity: _Floats, acceleration: _Floats) -> _Floats: ...
def required_acceleration(
    headway: _Floats, follower: _Floats, leader: _Floats, leader_acceleration: _Floats, leader_stops: bool
) -> _Floats: ...
def required_lateral_acceleration(time: _Floats, offset: _Floats, left: _Floats, right: _Floats) -> _Floats: ...
def minimal_stopping_distance(velocity: _Floats, deceleration: _Floats) -> _Floats: ...
def proportion_of_stopping_distance(remaining: _Floats, stopping: _Floats) -> _Floats: ...
def exposure(ttc: _Floats, threshold: float, dt: float) -> tuple[float, float]: ...
def participant_mass(kinds: Sequence[int], length: _Floats, width: _Floats) -> _Floats: ...
def boundary_harm(kind: int, impact_speed: float) -> float: ...
def collision_harm(
    kinds: tuple[int, int],
    masses: tuple[float, float],
    velocities: tuple[float, float],
    orientations: tuple[float, float],
    positions: tuple[tuple[float, float], tuple[float, float]],
    asymmetric: bool,
) -> tuple[float, tuple[float, float, float, str], tuple[float, float, float, str]]: ...
def overlapping_lanelets(road: RoadNetwork, erosion: float, overlap_min: float) -> list[tuple[int, int]]: ...
def evaluate_criticality(
    dt: float,
    road: RoadNetwork,
    participants: Participants,
    *,
    judged: Sequence[int],
    deceleration: Sequence[float],
    connectors: Sequence[tuple[int, int]] | None,
    contacts: Sequence[tuple[int, int, int]],
    threads: int,
    settings: MeasureSettings,
) -> dict[str, Any]: ...
def drive_cut_ins(
    name: str, velocity: _Floats, other_velocity: _Floats, gap: _Floats, sideways: _Floats
) -> dict[str, Any]: ...
def drive_cut_outs(name: str, velocity: _Floats, front_distance: _Floats, sideways: _Floats) -> dict[str, Any]: ...
def drive_followings(name: str, velocity: _Floats, deceleration: _Floats) -> dict[str, Any]: ...
def rss_longitudinal(
    parameters: tuple[float, float, float, float, float], first: _Floats, second: _Floats, opposite: bool
) -> _Floats: ...
def rss_lateral(parameters: tuple[float, float, float, float], left: _Floats, right: _Floats) -> _Floats: ...
def crossing_lanelets(road: RoadNetwork, erosion: float, overlap_min: float) -> list[int]: ...
def follow_path(path: _Floats, x: _Floats, y: _Floats) -> tuple[_Floats, _Floats]: ...
def start_conflict(
    recorded: _Floats,
    starts: _Floats,
    sizes: _Floats,
    rows: Sequence[int],
    limits: tuple[float, float, float, Sequence[float]],
) -> tuple[int, int, str, float] | None: ...
def leaves_road(
    road: RoadNetwork, shape: Shape, vehicle: Vehicle, x: _Floats, y: _Floats, orientation: _Floats
) -> bool: ...

@final
class Traffic:
    def __new__(cls, dt: float, road: RoadNetwork, participants: Participants, crossing: Sequence[int]) -> Traffic: ...
    def straight_times(
        self, judged: Sequence[int], rear_axle_to_center: Sequence[float], horizon: float, threads: int
    ) -> tuple[_Floats, _Ints]: ...
    def approach(self, id: int, lengths: _Floats, widths: _Floats, steps_most: int) -> tuple[float, int | None]: ...
    def blame(
        self,
        contacts: Sequence[tuple[int, int, int, bool]],
        agent: tuple[float, float],
        others: tuple[float, float],
    ) -> dict[str, Any]: ...
    def preventability(self, conflicts: Sequence[tuple[int, int, int, bool, bool]]) -> dict[str, Any]: ...
    def is_on_crossing(self, x: _Floats, y: _Floats) -> _Bools: ...
