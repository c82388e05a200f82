"""Whether a footprint is on the road, against shapely and CommonRoad's road boundary."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest
import shapely
from bodies import Body, body_of
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad_dc import pycrcc
from commonroad_dc.boundary.boundary import create_road_boundary_obstacle

from interdrive import _core
from interdrive.native_settings import RoadSettings
from interdrive.scenario import Scenario, Shape
from interdrive.scenario.native import core_road

TOLERANCE = RoadSettings().gap_tolerance
POSES_PER_MAP = 900
#: Verdicts about slivers smaller than this [m²] are left open: the outlines of buffers are polygons.
SLIVER = 1e-4


class Map:
    """The union of all lanelets of a map, and what the core's documentation adds to it."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.lanelets = scenario, scenario.lanelets
        self.polygons = [
            shapely.make_valid(
                shapely.Polygon(np.vstack([left, right[::-1]])), method="structure", keep_collapsed=False
            )
            for left, right in zip(self.lanelets.left, self.lanelets.right, strict=True)
        ]
        self.union = shapely.unary_union(self.polygons)

    @cached_property
    def surely_road(self) -> shapely.Geometry:
        """The lanelets with the hairline gaps between them."""
        return _prepared(self.union.buffer(0.5 * TOLERANCE, quad_segs=32).buffer(-0.5 * TOLERANCE, quad_segs=32))

    @cached_property
    def at_most_road(self) -> shapely.Geometry:
        """The same with all that the documentation counts as road besides: small holes, joints, seams."""
        return _prepared(self.with_seams.buffer(TOLERANCE, quad_segs=32))

    @cached_property
    def with_seams(self) -> shapely.Geometry:
        """Lanelets, small holes, joints and seams."""
        pieces = [self.surely_road, *self._small_holes(), *self._joints(), *self._seams()]
        return _prepared(shapely.unary_union(pieces))

    def _small_holes(self) -> list[shapely.Geometry]:
        """Enclosed holes of up to 1 m²; gaps within the tolerance may be part of what encloses them."""
        closed = self.union.buffer(TOLERANCE).buffer(-TOLERANCE)
        rings = [ring for geometry in (self.union, closed) for part in _parts(geometry) for ring in part.interiors]
        holes = [shapely.Polygon(ring) for ring in rings]
        return [hole for hole in holes if hole.area <= 1.1 and hole.length <= 16.0]

    def _joints(self) -> list[shapely.Geometry]:
        """Between a lanelet and its successor, up to 3 m."""
        row_of = {i: row for row, i in enumerate(self.lanelets.ids.tolist())}
        joints = []
        for row, successors in enumerate(self.lanelets.successors):
            stated = {row_of[i] for i in successors if i in row_of}
            stated |= {r for r, before in enumerate(self.lanelets.predecessors) if self.lanelets.ids[row] in before}
            for other in stated:
                end = np.array([self.lanelets.left[row][-1], self.lanelets.right[row][-1]])
                start = np.array([self.lanelets.left[other][0], self.lanelets.right[other][0]])
                if np.hypot(*(end - start).T).max() <= 3.0:
                    joints.append(shapely.MultiPoint(np.vstack([end, start])).convex_hull)
        return [joint for joint in joints if joint.area > 0]

    def _seams(self) -> list[shapely.Geometry]:
        """Between stated neighbours, up to 0.5 m."""
        row_of = {i: row for row, i in enumerate(self.lanelets.ids.tolist())}
        seams = []
        sides = ((self.lanelets.adjacent_left, self.lanelets.left), (self.lanelets.adjacent_right, self.lanelets.right))
        for neighbours, bounds in sides:
            for row, neighbour in enumerate(neighbours.tolist()):
                if neighbour not in row_of:
                    continue
                here = shapely.LineString(bounds[row]).buffer(0.5)
                there = self.lanelets.left[row_of[neighbour]], self.lanelets.right[row_of[neighbour]]
                seams += [here.intersection(shapely.LineString(bound).buffer(0.5)) for bound in there]
        return seams

    @cached_property
    def beyond_open_ends(self) -> shapely.Geometry:
        """Generous strips beyond all ends of lanelets that have no successor or predecessor."""
        strips = []
        for row in range(len(self.lanelets.ids)):
            left, right = self.lanelets.left[row], self.lanelets.right[row]
            center = 0.5 * (left + right)
            for linked, at, other in ((self.lanelets.successors[row], -1, -2), (self.lanelets.predecessors[row], 0, 1)):
                if linked:
                    continue
                corners = np.array([left[at], right[at]])
                # The direction is that of the last few metres: open it up to both sides.
                along = np.hypot(*(center - center[at]).T)
                near = center[(along > 0.01) & (along < 8.0)]
                away = center[at] - (near if len(near) else center[[other]])
                away = 130.0 * away / np.hypot(*away.T)[:, None]
                far = [corner + direction for corner in corners for direction in away]
                strips.append(shapely.MultiPoint(np.vstack([corners, far])).convex_hull.buffer(3.0))
        return _prepared(shapely.unary_union(strips) if strips else shapely.Polygon())


def _prepared(geometry: shapely.Geometry) -> shapely.Geometry:
    shapely.prepare(geometry)
    return geometry


def _parts(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"]


@dataclass(frozen=True)
class Probes:
    """Footprints at poses on one map, all of one body per group."""

    body: Body
    shape: Shape
    poses: np.ndarray

    def shrunk(self, by: float) -> np.ndarray:
        """Footprints, smaller all around."""
        if self.shape.kind == "circle":
            return shapely.buffer(self.body.at(self.poses), self.shape.radius - by, quad_segs=32)
        smaller = Shape("rectangle", max(self.shape.length - 2 * by, 1e-3), max(self.shape.width - 2 * by, 1e-3))
        return body_of(smaller).at(self.poses)


@pytest.fixture(scope="session")
def maps(recorded) -> list[Map]:
    """Every different map once, that of the file with most recorded vehicles."""
    found: dict[bytes, Scenario] = {}
    for scenario in recorded:
        key = b"".join(bound.tobytes() for bound in scenario.lanelets.left)
        if key not in found or len(found[key].obstacles.ids) < len(scenario.obstacles.ids):
            found[key] = scenario
    assert len(found) >= 0.3 * len(recorded)
    return [Map(scenario) for scenario in found.values()]


def probes_of(scenario: Scenario, seed: int) -> list[Probes]:
    """Recorded poses as they are and shifted sideways, and cars anywhere on lanelets, shifted and turned."""
    rng, probes = np.random.default_rng(seed), []
    o = scenario.obstacles
    rows = [row for row in range(len(o.ids)) if o.shapes[row].kind in ("rectangle", "circle")]
    plain = [row for row in rows if o.shapes[row].center == (0.0, 0.0) and o.shapes[row].orientation == 0.0]
    for row in plain:
        steps = np.flatnonzero(o.valid[row])
        steps = rng.choice(steps, min(len(steps), max(1, POSES_PER_MAP // (3 * len(plain)))), replace=False)
        poses = np.column_stack([o.x[row, steps], o.y[row, steps], o.orientation[row, steps]])
        probes.append(_probes(o.shapes[row], np.vstack([poses, sideways(poses, rng)])))
    lanelet_poses = []
    for _ in range(POSES_PER_MAP // 3):
        row = int(rng.integers(len(scenario.lanelets.ids)))
        center = 0.5 * (scenario.lanelets.left[row] + scenario.lanelets.right[row])
        k, fraction = int(rng.integers(len(center) - 1)), rng.random()
        step = center[k + 1] - center[k]
        lanelet_poses.append((*(center[k] + fraction * step), np.arctan2(step[1], step[0]) + rng.normal(0.0, 0.1)))
    probes.append(_probes(Shape("rectangle", 4.5, 1.8), sideways(np.array(lanelet_poses), rng)))
    return probes


def _probes(shape: Shape, poses: np.ndarray) -> Probes:
    return Probes(body_of(shape), shape, poses)


def sideways(poses: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Shifted by 0 to 4 m to the left or right."""
    offset = rng.uniform(-4.0, 4.0, len(poses))
    turned = poses[:, 2] + rng.normal(0.0, 0.05, len(poses))
    return np.column_stack(
        [poses[:, 0] - offset * np.sin(poses[:, 2]), poses[:, 1] + offset * np.cos(poses[:, 2]), turned]
    )


def core_covers(road: _core.RoadNetwork, probes: Probes) -> np.ndarray:
    return np.array([road.covers(probes.body.handle, *pose) for pose in probes.poses.tolist()])


@pytest.mark.parametrize("open_ends", [False, True], ids=["the map alone", "with open ends"])
def test_footprints_are_on_the_road_where_shapely_says_so(open_ends, maps, measured):
    """Two sided, with open ends only away from them.

    Off: what leaves lanelets and documented seams by more than the tolerance, after the footprint has been made smaller
    by the tolerance, must be refused. On: footprints that lie on lanelets and hairline gaps must be accepted.

    In between, one deviation is known: where lanelets overlap by less than the tolerance, the inner border of the two
    stays a road edge. There the tolerance of a footprint is up to 0.1 m smaller.
    """
    length = RoadSettings().open_end_length if open_ends else 0.0
    n, n_on, gaps, missed, refused, early = 0, 0, 0, [], [], []
    furthest = deepest = 0.0
    for k, road_map in enumerate(maps):
        road = core_road(road_map.scenario, RoadSettings(open_end_length=length))
        edges = shapely.linestrings(np.asarray(road.road_edges).reshape(-1, 2, 2))
        for probes in probes_of(road_map.scenario, k):
            inner, whole = probes.shrunk(TOLERANCE), probes.shrunk(0.0)
            ours = core_covers(road, probes)
            counts = ~shapely.intersects(road_map.beyond_open_ends, inner) if open_ends else np.ones(len(inner), bool)
            n, n_on = n + int(counts.sum()), n_on + int((ours & counts).sum())
            accepted, rejected = counts & ours, counts & ~ours
            where = (road_map.scenario.name, probes.shape.kind, probes.shape.length, probes.shape.width)
            off_area = _outside(inner, road_map.at_most_road)
            missed += [
                (off_area[i], *where, *probes.poses[i].tolist()) for i in np.flatnonzero(accepted & (off_area > SLIVER))
            ]
            for i in np.flatnonzero(accepted & ~shapely.covers(road_map.surely_road, inner)):
                gaps += how_far_off(inner[i], road_map.surely_road) > TOLERANCE + 1e-3
                furthest = max(furthest, how_far_off(inner[i], road_map.with_seams))
            on_lanelets = shapely.covers(road_map.surely_road, whole)
            refused += [(*where, *probes.poses[i].tolist()) for i in np.flatnonzero(rejected & on_lanelets)]
            for i in np.flatnonzero(rejected & ~on_lanelets & shapely.covers(road_map.surely_road, inner)):
                entering = shapely.intersection(edges, inner[i])
                points = shapely.get_coordinates(shapely.segmentize(entering, 0.02))
                depth = shapely.distance(shapely.points(points), inner[i].exterior).max()
                deepest = max(deepest, float(depth))
                early.append((depth, *where, *probes.poses[i].tolist()))
    name = "with open ends" if open_ends else "the map alone"
    remark = f"{len(maps)} maps, {n_on} accepted, {gaps} of them over documented gaps"
    measured(f"road, {name}: accepted off the lanelets", n, len(missed), 0, "poses", remark, sorted(missed)[::-1])
    measured(f"road, {name}: accepted, smaller footprint beyond the lanelets", n_on, furthest, TOLERANCE + 1e-3, "m")
    measured(f"road, {name}: refused on lanelets", n, len(refused), 0, "poses", "", refused)
    remark = f"{len(early)} poses"
    measured(f"road, {name}: refused, edges inside the smaller footprint", n, deepest, TOLERANCE, "m", remark, early)


def how_far_off(footprint: shapely.Geometry, road: shapely.Geometry) -> float:
    """Largest distance of a point of the footprint from the road [m], to a millimetre."""
    off, near = footprint.difference(road), road.intersection(footprint.envelope.buffer(5.0))
    low, high = 0.0, 5.0
    if off.is_empty:
        return 0.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if near.buffer(middle, quad_segs=32).covers(off) else (middle, high)
    return low


def _outside(inner: np.ndarray, road: shapely.Geometry) -> np.ndarray:
    """Area of every footprint off the road; 0 exactly where it is on it."""
    off = ~shapely.covers(road, inner)
    area = np.zeros(len(inner))
    area[off] = shapely.area(shapely.difference(inner[off], road))
    return area


def test_footprints_are_on_the_road_where_the_drivability_checker_says_so(maps, measured):
    """Its triangles cover all that is off the road: what we refuse must hit them, what we accept must not.

    The checker knows no tolerance, so the whole footprint counts where we refuse, and one that is smaller by twice the
    tolerance where we accept. Its road is not the union of the lanelets everywhere: it takes the outermost bounds of
    neighbours, which fills what lies between them and follows wrong adjacencies. Poses there are left out and counted,
    and so are accepted ones over gaps between lanelets.
    """
    n, left_out, slivers, unbuilt, own_maps, unhit, hit = 0, 0, 0, [], [], [], []
    for k, road_map in enumerate(maps):
        scenario = road_map.scenario
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                theirs, _ = CommonRoadFileReader(str(scenario.path)).open(lanelet_assignment=False)
                boundary = create_road_boundary_obstacle(
                    theirs, "aligned_triangulation", return_scenario_obstacle=False
                )
        except Exception as error:  # noqa: BLE001 - whatever the checker cannot build is no comparison
            unbuilt.append((scenario.name, type(error).__name__))
            continue
        checker = pycrcc.CollisionChecker()
        checker.add_collision_object(boundary)
        within = _prepared(shapely.box(*road_map.union.bounds).buffer(10.0))
        off_road = shapely.unary_union(
            [shapely.Polygon(triangle.vertices()).buffer(0) for triangle in boundary.unpack()]
        )
        differs = shapely.unary_union([off_road & road_map.union, within - off_road - road_map.union]).buffer(-1e-3)
        own_maps += [(scenario.name, round(differs.area, 2))] if differs.area > 0.1 else []
        differs = _prepared(differs.buffer(2e-3))
        road = core_road(scenario, RoadSettings(open_end_length=0.0))
        for probes in probes_of(scenario, k):
            if probes.shape.kind != "rectangle":
                continue
            ours, whole = core_covers(road, probes), probes.shrunk(0.0)
            in_gap = ours & ~shapely.covers(road_map.union, probes.shrunk(2 * TOLERANCE))
            counts = shapely.covers(within, whole) & ~shapely.intersects(differs, whole) & ~in_gap
            left_out += int((~counts).sum())
            for i in np.flatnonzero(counts):
                by = 2 * TOLERANCE if ours[i] else 0.0
                half = max(0.5 * probes.shape.length - by, 1e-3), max(0.5 * probes.shape.width - by, 1e-3)
                x, y, orientation = probes.poses[i].tolist()
                hits = checker.collide(pycrcc.RectOBB(*half, orientation, x, y))
                n += 1
                if hits and ours[i] and shapely.intersection(off_road, probes.shrunk(by)[i]).area < SLIVER:
                    slivers += 1
                elif hits == ours[i]:
                    (hit if hits else unhit).append((scenario.name, *half, x, y, orientation))
    assert len(maps) - len(unbuilt) >= 0.7 * len(maps)
    remark = (
        f"{len(maps) - len(unbuilt)} maps, its road differs from the lanelets on {len(own_maps)}; {left_out} left out"
    )
    measured("road, drivability checker: refused by us, accepted by it", n, len(unhit), 0, "poses", remark, unhit)
    remark = f"{slivers} left open: slivers between triangles"
    measured("road, drivability checker: accepted by us, refused by it", n, len(hit), 0, "poses", remark, hit)
