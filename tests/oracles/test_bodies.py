"""Distance and overlap of footprints against shapely, and against CommonRoad's collision checker."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest
import shapely
from bodies import EXACT, EXACT_FAR_AWAY, body_of, core_distances, distances, poses_of, random_shape
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_object

from interdrive import Simulation
from interdrive.scenario import GoalState, InitialState, Obstacles, PlanningProblem, Scenario, Shape
from interdrive.testing import straight_road


@pytest.mark.parametrize("kinds", list(itertools.combinations_with_replacement(("rectangle", "circle", "polygon"), 2)))
def test_distances_of_invented_bodies_are_those_of_shapely(kinds, measured):
    rng = np.random.default_rng([len(kind) for kind in kinds])
    worst, n, overlaps = 0.0, 0, 0
    for _ in range(300):
        a, b = body_of(random_shape(rng, kinds[:1])), body_of(random_shape(rng, kinds[1:]))
        # Distances of the origins from nothing to well apart, and quite a few close calls.
        bearing, apart = rng.uniform(-np.pi, np.pi, 100), rng.uniform(0.0, 1.3, 100) * (a.reach + b.reach)
        a_poses = np.column_stack([rng.uniform(-50, 50, (100, 2)), rng.uniform(-7, 7, 100)])
        b_poses = np.column_stack(
            [a_poses[:, 0] + apart * np.cos(bearing), a_poses[:, 1] + apart * np.sin(bearing), rng.uniform(-7, 7, 100)]
        )
        ours, theirs = core_distances(a, a_poses, b, b_poses), distances(a, a_poses, b, b_poses)
        worst, n, overlaps = max(worst, np.abs(ours - theirs).max()), n + 100, overlaps + int((theirs == 0).sum())
    assert 0.1 < overlaps / n < 0.9
    measured(f"distance, invented: {kinds[0]} to {kinds[1]}", n, worst, EXACT, "m", f"{overlaps} overlap")


def test_distances_of_invented_groups_are_those_of_shapely(measured):
    rng, worst, n = np.random.default_rng(5), 0.0, 0
    for _ in range(200):
        members = [random_shape(rng) for _ in range(3)]
        bodies = [body_of(member) for member in members]
        whole = Shape("group", members=tuple(members))
        other = body_of(random_shape(rng))
        pose = np.array([[*rng.uniform(-9, 9, 2), rng.uniform(-4, 4)]])
        other_pose = np.array([[*rng.uniform(-9, 9, 2), rng.uniform(-4, 4)]])
        theirs = min(float(distances(body, pose, other, other_pose)[0]) for body in bodies)
        from interdrive.scenario.native import core_shape

        ours = core_shape(whole).distance(tuple(pose[0].tolist()), other.handle, tuple(other_pose[0].tolist()))
        worst, n = max(worst, abs(ours - theirs)), n + 1
    measured("distance, invented: group of three to anything", n, worst, EXACT, "m")


def test_distances_of_all_recorded_pairs_are_those_of_shapely(recorded, measured):
    """Every pair at every recorded step; overlap must agree but for contacts shallower than rounding."""
    worst, worst_far, n, n_scenarios, overlaps, wrong = 0.0, 0.0, 0, 0, 0, []
    for scenario in recorded:
        obstacles = scenario.obstacles
        bodies = [body_of(shape) for shape in obstacles.shapes]
        far_away = np.nanmax(np.abs(np.concatenate([bound.ravel() for bound in scenario.lanelets.left]))) > 1e5
        n_before = n
        for i, j in itertools.combinations(range(len(bodies)), 2):
            both = obstacles.valid[i] & obstacles.valid[j]
            if obstacles.is_static[i] and obstacles.is_static[j]:
                both[1:] = False
            if not both.any():
                continue
            a_poses, b_poses = poses_of(obstacles, i)[both], poses_of(obstacles, j)[both]
            ours, theirs = (
                core_distances(bodies[i], a_poses, bodies[j], b_poses),
                distances(bodies[i], a_poses, bodies[j], b_poses),
            )
            deviation = float(np.abs(ours - theirs).max())
            worst, worst_far = (worst, max(worst_far, deviation)) if far_away else (max(worst, deviation), worst_far)
            n, overlaps = n + len(ours), overlaps + int((theirs == 0).sum())
            verdicts_differ = (ours == 0) != (theirs == 0)
            if (verdicts_differ & (np.maximum(ours, theirs) > (EXACT_FAR_AWAY if far_away else EXACT))).any():
                wrong.append((scenario.name, int(obstacles.ids[i]), int(obstacles.ids[j])))
        n_scenarios += n > n_before
    assert n_scenarios >= 0.3 * len(recorded)
    remark = f"{n_scenarios} scenarios, {overlaps} overlap"
    measured("distance, recorded pairs at every step", n, worst, EXACT, "m", remark)
    measured("distance, recorded pairs, coordinates in the millions", n, worst_far, EXACT_FAR_AWAY, "m")
    measured("overlap, recorded pairs: different verdicts", n, len(wrong), 0, "pairs", "", wrong)


def test_overlaps_of_recorded_traffic_are_those_of_the_drivability_checker(recorded, measured):
    """Files read by commonroad-io and turned into time-variant objects by the checker; ours from our own arrays."""
    n, overlaps, wrong, n_scenarios = 0, 0, [], 0
    for scenario in recorded:
        obstacles = scenario.obstacles
        n_moving = int((~obstacles.is_static).sum())
        if n_moving < 2:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs, _ = CommonRoadFileReader(str(scenario.path)).open(lanelet_assignment=False)
        objects = {}
        for obstacle in theirs.dynamic_obstacles:
            if type(obstacle.prediction).__name__ == "TrajectoryPrediction" and _is_plain(obstacle):
                objects[obstacle.obstacle_id] = create_collision_object(obstacle)
        rows = [row for row, i in enumerate(obstacles.ids.tolist()) if i in objects]
        bodies = {row: body_of(obstacles.shapes[row]) for row in rows}
        n_scenarios += len(rows) > 1
        for i, j in itertools.combinations(rows, 2):
            a, b = objects[int(obstacles.ids[i])], objects[int(obstacles.ids[j])]
            # The checker makes its objects from the prediction: the initial state is not in them.
            both = obstacles.valid[i] & obstacles.valid[j]
            both[: max(a.time_start_idx(), b.time_start_idx())] = False
            both[min(a.time_end_idx(), b.time_end_idx()) + 1 :] = False
            steps = np.flatnonzero(both)
            apart = np.hypot(*(poses_of(obstacles, i)[steps] - poses_of(obstacles, j)[steps])[:, :2].T)
            for step in steps[apart <= bodies[i].reach + bodies[j].reach + 1.0].tolist():
                p, q = poses_of(obstacles, i)[step], poses_of(obstacles, j)[step]
                ours = float(core_distances(bodies[i], p, bodies[j], q)[0])
                hit = a.obstacle_at_time(step).collide(b.obstacle_at_time(step))
                n, overlaps = n + 1, overlaps + hit
                if hit != (ours == 0):
                    wrong.append((scenario.name, int(obstacles.ids[i]), int(obstacles.ids[j]), step, ours))
    assert n_scenarios >= 0.3 * len(recorded)
    measured(
        "overlap, recorded pairs within 1 m of reach: drivability checker",
        n,
        len(wrong),
        0,
        "pairs",
        f"{n_scenarios} scenarios, {overlaps} overlap",
        wrong,
    )


def _is_plain(obstacle) -> bool:
    states = obstacle.prediction.trajectory.state_list
    return all(isinstance(state.position, np.ndarray) and isinstance(state.orientation, float) for state in states)


def test_the_pairs_that_touch_when_they_enter_are_those_of_shapely(measured):
    """The core's fast overlap test, which the world uses for arrivals: invented bodies around an agent."""
    rng, wrong, n, touching = np.random.default_rng(11), [], 0, 0
    road = straight_road(2000.0, lane_width=400.0)
    for k in range(60):
        shapes = tuple(random_shape(rng) for _ in range(80))
        poses = np.column_stack([1000.0 + rng.uniform(-9, 9, 80), rng.uniform(-9, 9, 80), rng.uniform(-4, 4, 80)])
        agent_pose = (1000.0, 0.0, rng.uniform(-0.5, 0.5))
        run_in = Simulation(_standing(road, shapes, poses, agent_pose), agents=[10_000], threads=1)
        ours = {pair[0] if pair[1] == 10_000 else pair[1] for pair in run_in.world.entered_in_contact}
        agent = body_of(Shape("rectangle", run_in.agents[0].vehicle.length, run_in.agents[0].vehicle.width))
        for row, shape in enumerate(shapes):
            theirs = float(distances(agent, agent_pose, body_of(shape), poses[row])[0])
            n, touching = n + 1, touching + (theirs == 0)
            if (theirs == 0) != (row + 1 in ours):
                wrong.append((k, row, theirs))
    measured("overlap when entering the world, invented", n, len(wrong), 0, "pairs", f"{touching} overlap")


def _standing(road, shapes: tuple[Shape, ...], poses: np.ndarray, agent_pose: tuple[float, float, float]) -> Scenario:
    n = len(shapes)
    column = {name: poses[:, [k]] for k, name in enumerate(("x", "y", "orientation"))}
    zeros = {name: np.zeros((n, 1)) for name in ("velocity", "acceleration", "yaw_rate")}
    obstacles = Obstacles(
        ids=np.arange(1, n + 1),
        kinds=("car",) * n,
        shapes=shapes,
        is_static=np.ones(n, dtype=bool),
        valid=np.ones((n, 1), dtype=bool),
        **column,
        **zeros,
    )
    area = Shape("rectangle", 50.0, 300.0, center=(1900.0, 0.0))
    start = InitialState(0, *agent_pose, 5.0)
    problem = PlanningProblem(10_000, start, (GoalState((area,), (), (0, 500)),))
    return Scenario("standing", "standing", 0.1, road, obstacles, (problem,))


def test_polygons_from_real_files_keep_their_area(recorded, measured):
    """Polygonal footprints are cut into convex parts: a dense grid of points must be in or out as in shapely."""
    n, wrong = 0, 0
    probe = body_of(Shape("circle", radius=1e-9))
    for scenario in recorded:
        for shape in scenario.obstacles.shapes:
            if shape.kind != "polygon":
                continue
            body = body_of(shape)
            low_x, low_y, high_x, high_y = body.geometry.bounds
            x, y = np.meshgrid(np.linspace(low_x - 0.1, high_x + 0.1, 25), np.linspace(low_y - 0.1, high_y + 0.1, 25))
            points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
            ours = core_distances(body, np.zeros((len(points), 3)), probe, points) == 0
            theirs = shapely.distance(body.geometry, shapely.points(points[:, :2])) <= 1e-9
            n, wrong = n + len(points), wrong + int((ours != theirs).sum())
    measured("polygons of real files: points inside", n, wrong, 0, "points")
