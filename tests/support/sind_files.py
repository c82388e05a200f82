"""A small Lanelet2 map with a light, and a recording of SinD with a table of states for it."""

NODES = {
    **{1: (0, 3.5), 2: (50, 3.5), 3: (100, 3.5), 4: (0, 0), 5: (50, 0), 6: (100, 0)},
    **{7: (57, -9), 8: (53.5, -9), 9: (55, 1.5), 10: (53, -1.5), 11: (51, 6), 12: (51, 8)},
}
WAYS = {101: (1, 2), 102: (2, 3), 103: (4, 5), 104: (5, 6), 107: (2, 5), 108: (11, 12)}
WAYS |= {105: (2, 9, 7), 106: (5, 10, 8)}
TRACKS = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,yaw_rad,heading_rad,length,width,ax,ay\n" + "".join(
    f"4,{3 * k},{1000 + 100 * k},car,{5 + k},1.75,10,0,0,0,4.5,1.8,0,0\n" for k in range(81)
)
STATES = """RawFrameID,timestamp(ms),Traffic light 1,Traffic light 2,Pedestrian Traffic light 1
90,3000,0,1,0
-9,-500,1,0,0
120,4000,0,3,1
150,5000,0,7,1
180,6000,1,0,0
"""


def written(folder, states=STATES, name="Traffic light 2"):
    """A map with one light at the end of a lane that leads straight on and to the right, tracks, a table of states."""
    places = "".join(
        f'<node id="{key}" lat="{y / 110574:.9f}" lon="{x / 111320:.9f}"/>' for key, (x, y) in NODES.items()
    )
    kinds = {107: "stop_line", 108: "traffic_light"}
    ways = "".join(
        f'<way id="{key}">{"".join(f"""<nd ref="{node}"/>""" for node in nodes)}'
        f'<tag k="type" v="{kinds.get(key, "virtual")}"/>'
        + (f'<tag k="name" v="{name}"/>' if key == 108 else "")
        + "</way>"
        for key, nodes in WAYS.items()
    )
    lanes = "".join(
        f'<relation id="{key}"><member type="way" role="left" ref="{left}"/><member type="way" role="right" '
        f'ref="{right}"/><tag k="type" v="lanelet"/></relation>'
        for key, left, right in ((201, 101, 103), (202, 102, 104), (203, 105, 106))
    )
    rule = (
        '<relation id="300"><member type="way" role="ref_line" ref="107"/><member type="way" role="refers" ref="108"/>'
        '<tag k="type" v="regulatory_element"/><tag k="subtype" v="traffic_light"/></relation>'
    )
    (folder / "map.osm").write_text(f"<osm>{places}{ways}{lanes}{rule}</osm>")
    (folder / "Veh_smoothed_tracks.csv").write_text(TRACKS)
    if states:
        (folder / "TrafficLight_8_2_1.csv").write_text(states)
    return folder / "Veh_smoothed_tracks.csv"
