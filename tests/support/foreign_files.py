"""Small files of other tools, made here: a road of two lanes and back in the form of each."""

import json
import struct
import tempfile
from pathlib import Path

import numpy as np

LANELET2 = """<?xml version="1.0"?>
<osm version="0.6">
  {nodes}
  <way id="101"><nd ref="1"/><nd ref="2"/><tag k="type" v="curbstone"/><tag k="subtype" v="high"/></way>
  <way id="102"><nd ref="3"/><nd ref="4"/><tag k="type" v="line_thin"/><tag k="subtype" v="dashed"/></way>
  <way id="103"><nd ref="5"/><nd ref="6"/><tag k="type" v="line_thin"/><tag k="subtype" v="solid_dashed"/></way>
  <way id="104"><nd ref="7"/><nd ref="8"/><tag k="type" v="virtual"/></way>
  <way id="105"><nd ref="2"/><nd ref="9"/><tag k="type" v="line_thick"/><tag k="subtype" v="solid"/></way>
  <way id="106"><nd ref="4"/><nd ref="11"/><nd ref="10"/><tag k="type" v="line_thin"/></way>
  <relation id="201"><member type="way" role="left" ref="102"/><member type="way" role="right" ref="101"/>
    <member type="relation" role="regulatory_element" ref="301"/>
    <tag k="type" v="lanelet"/><tag k="subtype" v="road"/><tag k="speed_limit" v="30 mph"/></relation>
  <relation id="202"><member type="way" role="left" ref="103"/><member type="way" role="right" ref="102"/>
    <tag k="type" v="lanelet"/><tag k="subtype" v="road"/><tag k="speed_limit" v="36"/></relation>
  <relation id="203"><member type="way" role="left" ref="103"/><member type="way" role="right" ref="104"/>
    <tag k="type" v="lanelet"/><tag k="subtype" v="road"/></relation>
  <relation id="204"><member type="way" role="left" ref="106"/><member type="way" role="right" ref="105"/>
    <tag k="type" v="lanelet"/></relation>
  <relation id="205"><member type="way" role="left" ref="104"/><member type="way" role="right" ref="103"/>
    <tag k="type" v="lanelet"/><tag k="subtype" v="bus_lane"/></relation>
  <relation id="206"><member type="way" role="left" ref="104"/><tag k="type" v="lanelet"/></relation>
  <relation id="301"><tag k="type" v="regulatory_element"/><tag k="subtype" v="speed_limit"/>
    <tag k="sign_type" v="50kmh"/></relation>
</osm>
"""
#: Nodes of the map above [m].
NODES = {
    **{1: (0.0, 0.0), 2: (60.0, 0.0), 3: (0.0, 3.5), 4: (60.0, 3.5), 5: (0.0, 7.0), 6: (60.0, 7.0)},
    **{7: (0.0, 10.5), 8: (60.0, 10.5), 9: (100.0, 0.0), 10: (100.0, 3.5), 11: (80.0, 3.6)},
}


def lanelet2(local=True):
    """Two lanes, one in the other direction, one that goes on, a lane for buses, and a lane without a border."""
    nodes = "".join(
        f'<node id="{number}" lat="{48.0 + y / 111e3:.9f}" lon="{11.0 + x / 74e3:.9f}">'
        + (f'<tag k="local_x" v="{x}"/><tag k="local_y" v="{y}"/>' if local else "")
        + "</node>"
        for number, (x, y) in NODES.items()
    )
    return LANELET2.format(nodes=nodes)


def tracks(rows, columns="track_id,time_s,x,y,heading,speed,length,width,kind"):
    """Neutral tracks as CSV."""
    return "\n".join([columns, *(",".join(map(str, row)) for row in rows)]) + "\n"


def car(name="7", y=1.75, n=41, dt=0.1, speed=10.0, kind="car"):
    """Rows of a vehicle that drives along the road."""
    return [(name, round(k * dt, 6), 5.0 + speed * k * dt, y, 0.0, speed, 4.5, 1.8, kind) for k in range(n)]


LANES = "lane_id,side,point,x,y\n" + "".join(
    f"{lane},{side},{point},{x},{y}\n"
    for lane, left, right, ends in (("east", 3.5, 0.0, (0.0, 60.0)), ("on", 3.5, 0.0, (60.0, 120.0)),
                                    ("west", 3.5, 7.0, (120.0, 0.0)))
    for side, y in (("left", left), ("right", right))
    for point, x in enumerate(ends)
)  # fmt: skip
LINKS = "lane_id,relation,other_id\neast,successor,on\neast,left_opposite,west\nwest,left_opposite,east\n"


def neutral_map(folder):
    """lanes.csv and links.csv in a folder; the path of the first."""
    (folder / "lanes.csv").write_text(LANES)
    (folder / "links.csv").write_text(LINKS)
    return folder / "lanes.csv"


def driven(lanelets):
    """Rows of the lanelets that are no crosswalks."""
    return [row for row, kinds in enumerate(lanelets.types) if "crosswalk" not in kinds]


def argoverse2(folder):
    """A scenario of Argoverse 2 with two lanes, a car and a pedestrian, in a folder; its path."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def line(y, x=(0.0, 60.0)):
        return [{"x": one, "y": y, "z": 0.0} for one in x]

    def segment(number, left, right, kind="VEHICLE", **more):
        stated = {"successors": [], "predecessors": [], "left_neighbor_id": None, "right_neighbor_id": None}
        borders = {"left_lane_boundary": left, "right_lane_boundary": right}
        marks = {"left_lane_mark_type": "DASHED_WHITE", "right_lane_mark_type": "SOLID_WHITE"}
        return {"id": number, "lane_type": kind, **borders, **marks, **stated, **more}

    segments = {
        "11": segment(11, line(3.5), line(0.0, (0.0, 20.0, 60.0)), left_neighbor_id=12, successors=[13, 99]),
        "12": segment(12, line(3.5, (60.0, 0.0)), line(7.0, (60.0, 0.0)), left_neighbor_id=11),
        "13": segment(13, line(3.5, (60.0, 100.0)), line(0.0, (60.0, 100.0))),
        "14": segment(14, line(0.0), line(-1.5), kind="BIKE"),
    }
    crossing = {"8": {"id": 8, "edge1": line(0.0), "edge2": line(3.0)}}
    document = {"lane_segments": segments, "pedestrian_crossings": crossing, "drivable_areas": {}}
    rows = [("AV", "vehicle", k, 5.0 + k, 1.75, 0.0, 10.0, 0.0) for k in range(41)]
    rows += [("3", "pedestrian", k, 30.0, -2.0 + 0.14 * k, np.pi / 2, 0.0, 1.4) for k in range(41)]
    rows += [("4", "static", k, 0.0, 0.0, 0.0, 0.0, 0.0) for k in range(41)]
    names = ("track_id", "object_type", "timestep", "position_x", "position_y", "heading", "velocity_x", "velocity_y")
    table = {name: list(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
    table["focal_track_id"] = ["3"] * len(rows)
    folder.mkdir(exist_ok=True)
    pq.write_table(pa.table(table), folder / "scenario_a.parquet")
    (folder / "log_map_archive_a.json").write_text(json.dumps(document))
    return folder


def womd():
    """A scene of the Waymo Open Motion Dataset: two parallel lanes and one that goes on, a car and a pedestrian."""

    def line(x, y):
        return [{"x": float(one), "y": y, "z": 0.0} for one in np.arange(x[0], x[1] + 0.25, 0.5)]

    def one(kind, geometry, number, element=2):
        return {"type": kind, "geometry": geometry, "map_element_id": element, "id": number}

    n = 41

    def moved(x, y, vx, vy, **more):
        time = 0.1 * np.arange(n)
        place = [{"x": float(x + vx * t), "y": float(y + vy * t), "z": 0.0} for t in time]
        return {"position": place, "velocity": [{"x": vx, "y": vy}] * n, "valid": [True] * n, **more}

    gone = moved(5.0, 1.75, 0.0, 0.0, length=4.5, width=1.8, heading=[0.0] * n, type="vehicle", id=9)
    return {
        "name": "scene", "scenario_id": "a", "tl_states": {},
        "roads": [
            one("lane", line((0, 60), 1.75), 1), one("lane", line((0, 60), 5.25), 2),
            one("lane", line((60, 100), 1.75), 3), one("lane", line((0, 60), -3.0), 4, 3),
            one("road_edge", line((0, 100), 0.0), 5, 15), one("stop_sign", line((50, 50.2), 0.0), 6, 17),
        ],
        "objects": [
            moved(5.0, 1.75, 10.0, 0.0, length=4.5, width=1.8, heading=[0.0] * n, type="vehicle", id=7),
            moved(30.0, -2.0, 0.0, 1.4, length=0.6, width=0.8, heading=[np.pi / 2] * n, type="pedestrian", id=8),
            {**gone, "valid": [False] * n},
            moved(80.0, 5.25, -9.0, 0.0, length=8.0, width=2.5, heading=[np.pi] * n, type="vehicle", id=4),
        ],
        "metadata": {"sdc_track_index": 0, "tracks_to_predict": [{"track_index": 3, "difficulty": 0}]},
    }  # fmt: skip


def osi_messages(n=31, dt=0.1, with_lanes=True):
    """Ground truths of a car, a pedestrian and a post, on a lane that has boundaries."""
    import betterosi as osi

    def vector(x, y):
        return osi.Vector3d(x=x, y=y, z=0.0)

    def base(x, y, yaw, vx, vy, length, width):
        return osi.BaseMoving(
            dimension=osi.Dimension3d(length=length, width=width, height=1.5),
            position=vector(x, y), orientation=osi.Orientation3d(yaw=yaw), velocity=vector(vx, vy),
        )  # fmt: skip

    vehicle, found = osi.MovingObject.VehicleClassification, []
    boundaries = [
        osi.LaneBoundary(
            id=osi.Identifier(value=number),
            boundary_line=[osi.LaneBoundary.BoundaryPoint(position=vector(x, y)) for x in (0.0, 50.0, 100.0)],
            classification=osi.LaneBoundary.Classification(type=osi.LaneBoundary.Classification.Type.SOLID_LINE),
        )
        for number, y in ((21, 3.5), (22, 0.0))
    ]
    lane = osi.Lane(
        id=osi.Identifier(value=20),
        classification=osi.Lane.Classification(
            type=osi.Lane.Classification.Type.DRIVING,
            centerline=[vector(0.0, 1.75), vector(100.0, 1.75)],
            centerline_is_driving_direction=True,
            left_lane_boundary_id=[osi.Identifier(value=21)],
            right_lane_boundary_id=[osi.Identifier(value=22)],
        ),
    )
    for k in range(n):
        nanos = round(k * dt * 1e9)
        found.append(
            osi.GroundTruth(
                timestamp=osi.Timestamp(seconds=nanos // 10**9, nanos=nanos % 10**9),
                host_vehicle_id=osi.Identifier(value=1),
                moving_object=[
                    osi.MovingObject(
                        id=osi.Identifier(value=1), base=base(5.0 + 10.0 * k * dt, 1.75, 0.0, 10.0, 0.0, 4.5, 1.8),
                        type=osi.MovingObject.Type.VEHICLE, vehicle_classification=vehicle(type=vehicle.Type.BUS),
                    ),
                    osi.MovingObject(
                        id=osi.Identifier(value=2), base=base(30.0, -2.0 + 1.4 * k * dt, 1.57, 0.0, 1.4, 0.5, 0.6),
                        type=osi.MovingObject.Type.PEDESTRIAN,
                    ),
                ],
                stationary_object=[] if k else [
                    osi.StationaryObject(
                        id=osi.Identifier(value=3),
                        base=osi.BaseStationary(dimension=osi.Dimension3d(length=0.4, width=0.3, height=2.0),
                                                position=vector(40.0, -2.0), orientation=osi.Orientation3d(yaw=0.0)),
                    )
                ],
                lane=[lane] if with_lanes and not k else [], lane_boundary=boundaries if with_lanes and not k else [],
            )
        )  # fmt: skip
    return found


def osi_control(messages):
    """The messages with a lane that goes on, and a light, a stop sign and a crosswalk of the first lane."""
    import betterosi as osi

    lamp, sign = osi.TrafficLight.Classification, osi.TrafficSign.MainSign
    assigned = [osi.Identifier(value=20)]
    boundaries = [
        osi.LaneBoundary(
            id=osi.Identifier(value=number),
            boundary_line=[osi.LaneBoundary.BoundaryPoint(position=osi.Vector3d(x=x, y=y, z=0.0)) for x in (100, 150)],
        )
        for number, y in ((31, 3.5), (32, 0.0))
    ]
    following = osi.Lane.Classification(
        type=osi.Lane.Classification.Type.DRIVING,
        centerline=[osi.Vector3d(x=x, y=1.75, z=0.0) for x in (100.0, 150.0)],
        centerline_is_driving_direction=True,
        left_lane_boundary_id=[osi.Identifier(value=31)],
        right_lane_boundary_id=[osi.Identifier(value=32)],
        lane_pairing=[osi.Lane.Classification.LanePairing(antecessor_lane_id=osi.Identifier(value=20))],
    )
    messages[0].lane.append(osi.Lane(id=osi.Identifier(value=30), classification=following))
    messages[0].lane_boundary.extend(boundaries)
    for at, message in enumerate(messages):
        for number, (colour, lit) in enumerate((("RED", at < 10), ("YELLOW", 5 <= at < 10), ("GREEN", at >= 10)), 40):
            said = lamp(
                color=lamp.Color[colour],
                mode=lamp.Mode.CONSTANT if lit else lamp.Mode.OFF,
                icon=lamp.Icon.NONE,
                assigned_lane_id=assigned,
            )
            message.traffic_light.append(osi.TrafficLight(id=osi.Identifier(value=number), classification=said))
    stop = sign.Classification(type=sign.Classification.Type.STOP, assigned_lane_id=assigned)
    messages[0].traffic_sign.append(osi.TrafficSign(id=osi.Identifier(value=50), main_sign=sign(classification=stop)))
    zebra = osi.RoadMarking.Classification(
        type=osi.RoadMarking.Classification.Type.PAINTED_TRAFFIC_SIGN,
        traffic_main_sign_type=sign.Classification.Type.ZEBRA_CROSSING,
    )
    base = osi.BaseStationary(
        dimension=osi.Dimension3d(length=3.0, width=8.0, height=0.0), position=osi.Vector3d(x=50.0, y=2.0, z=0.0)
    )
    messages[0].road_marking.append(osi.RoadMarking(id=osi.Identifier(value=51), classification=zebra, base=base))
    return messages


def osi_mcap(messages):
    """Messages as an MCAP file."""
    import betterosi as osi

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "trace.mcap")
        with osi.Writer(path, topic="ground_truth", metadata={"creation_time": "1970-01-01T00:00:00Z"}) as writer:
            for message in messages:
                writer.add(message)
        return path.read_bytes()


def osi_trace(messages):
    """Messages behind their lengths, as in a file with the ending .osi."""
    bodies = [message.to_binary() for message in messages]
    return b"".join(struct.pack("<I", len(body)) + body for body in bodies)


HIGHD = {
    "01_recordingMeta.csv": "id,frameRate,locationId,speedLimit,upperLaneMarkings,lowerLaneMarkings\n"
    "1,25,2,36.11,8.5;12.5;16.5,21.0;25.0\n",
    "01_tracksMeta.csv": "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection\n"
    "1,4.8,2.0,1,51,51,Car,1\n2,12.0,2.5,1,51,51,Truck,2\n",
    "01_tracks.csv": "frame,id,x,y,width,height,xVelocity,yVelocity,laneId\n"
    + "".join(f"{k + 1},1,{300 - 1.2 * k:.2f},9.5,4.8,2.0,-30.0,0.0,2\n" for k in range(51))
    + "".join(f"{k + 1},2,{50 + 0.8 * k:.2f},21.75,12.0,2.5,20.0,0.0,5\n" for k in range(51)),
}
IND = {
    "00_recordingMeta.csv": "recordingId,locationId,frameRate,speedLimit,xUtmOrigin,yUtmOrigin\n"
    "0,4,25,-1,649000.0,5318000.0\n",
    "00_tracksMeta.csv": "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class\n"
    "0,0,0,50,51,1.8,4.5,car\n0,1,0,50,51,0.0,0.0,pedestrian\n0,2,0,50,51,0.0,0.0,bicycle\n",
    "00_tracks.csv": "recordingId,trackId,frame,xCenter,yCenter,heading,width,length,xVelocity,yVelocity\n"
    + "".join(f"0,0,{k},{40 + 0.4 * k:.3f},-30.0,{(355 + 0.2 * k) % 360:.1f},1.8,4.5,10.0,0.0\n" for k in range(51))
    + "".join(f"0,1,{k},50.0,{-20 + 0.05 * k:.3f},90.0,0.0,0.0,0.0,1.25\n" for k in range(51))
    + "".join(f"0,2,{k},{60 - 0.16 * k:.3f},-33.0,180.0,0.0,0.0,-4.0,0.0\n" for k in range(51)),
}
INTERACTION = (
    "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"
    + "".join(f"1,{k + 1},{100 * (k + 1)},car,{5 + k},1.75,10,0,0,4.5,1.8\n" for k in range(41))
    + "".join(f"2,{k + 1},{100 * (k + 1)},car,{60 - k},5.25,-10,0,3.1415927,4.5,1.8\n" for k in range(41))
)
INTERACTION_PEDESTRIANS = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy\n" + "".join(
    f"P1,{k + 1},{100 * (k + 1)},pedestrian/bicycle,30,{-2 + 0.14 * k:.3f},0,1.4\n"
    f"P2,{k + 1},{100 * (k + 1)},pedestrian/bicycle,{30 + 0.5 * k:.3f},-1,5,0\n"
    for k in range(41)
)


def saved(folder, files):
    """Writes files by name into a folder, which is made; the folder."""
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder
