"""Small CommonRoad documents for tests: one straight lanelet of 100 m, and whatever a test puts on it."""

from pathlib import Path

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE bomb [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<commonRoad>&b;</commonRoad>"""
EXTERNAL_ENTITY = b"""<?xml version="1.0"?>
<!DOCTYPE x [<!ENTITY secret SYSTEM "file:///etc/hostname">]>
<commonRoad>&secret;</commonRoad>"""

RECTANGLE = "<rectangle><length>4.5</length><width>1.8</width></rectangle>"


def document(content="", *, version="2020a", dt="0.1", lanelets=None):
    """A document; `content` follows the lanelets."""
    lanelets = lanelet(1) if lanelets is None else lanelets
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<commonRoad benchmarkID="ZAM_Test-1_1_T-1" commonRoadVersion="{version}" timeStepSize="{dt}" author="a" affiliation="b"
 source="c" date="2026-01-01" tags="urban">
{"<scenarioTags><urban/></scenarioTags>" if version == "2020a" else ""}{lanelets}{content}
</commonRoad>"""


def point(x, y, z=None):
    return f"<point><x>{x}</x><y>{y}</y>{'' if z is None else f'<z>{z}</z>'}</point>"


def lanelet(number, *, left=((0, 2), (100, 2)), right=((0, -2), (100, -2)), more=""):
    bounds = "".join(
        f"<{side}>{''.join(point(*p) for p in points)}</{side}>"
        for side, points in (("leftBound", left), ("rightBound", right))
    )
    return f'<lanelet id="{number}">{bounds}{more}</lanelet>'


def rectangle_at(x, y, *, length, width, orientation=0.0):
    return (
        f"<rectangle><length>{length}</length><width>{width}</width><orientation>{orientation}</orientation>"
        f"<center><x>{x}</x><y>{y}</y></center></rectangle>"
    )


def speed_sign(number, limit):
    element = f"<trafficSignID>274</trafficSignID><additionalValue>{limit}</additionalValue>"
    return f'<trafficSign id="{number}"><trafficSignElement>{element}</trafficSignElement></trafficSign>'


def traffic_light(number, *phases, offset=0, direction="all", active="true"):
    """A light; phases are pairs of colour and length in time steps."""
    cycle = "".join(
        f"<cycleElement><duration>{length}</duration><color>{colour}</color></cycleElement>"
        for colour, length in phases
    )
    return (
        f'<trafficLight id="{number}"><cycle>{cycle}<timeOffset>{offset}</timeOffset></cycle>'
        f"<position>{point(0, 0)}</position><direction>{direction}</direction><active>{active}</active></trafficLight>"
    )


def sign(number, code):
    """A sign without a value."""
    element = f"<trafficSignElement><trafficSignID>{code}</trafficSignID></trafficSignElement>"
    return f'<trafficSign id="{number}">{element}</trafficSign>'


def exact(tag, value):
    return f"<{tag}><exact>{value}</exact></{tag}>"


def interval(tag, first, last):
    return f"<{tag}><intervalStart>{first}</intervalStart><intervalEnd>{last}</intervalEnd></{tag}>"


def state(time, x, y=0.0, *, tag="state", position=None, **values):
    """A state; a value is a number or the (first, last) of an interval."""
    position = point(x, y) if position is None else position
    fields = "".join(
        interval(name, *value) if isinstance(value, tuple) else exact(name, value)
        for name, value in {**values, "time": time}.items()
    )
    return f"<{tag}><position>{position}</position>{fields}</{tag}>"


def car(number, initial, states=(), *, shape=RECTANGLE, kind="car", prediction=None):
    """A dynamic obstacle; `prediction` replaces the trajectory."""
    trajectory = f"<trajectory>{''.join(states)}</trajectory>" if states else ""
    return (
        f'<dynamicObstacle id="{number}"><type>{kind}</type><shape>{shape}</shape>{initial}'
        f"{trajectory if prediction is None else prediction}</dynamicObstacle>"
    )


def initial(x, y=0.0, *, time=0, orientation=0.0, velocity=10.0, **values):
    fields = {"orientation": orientation, "velocity": velocity, **values}
    return state(time, x, y, tag="initialState", **{k: v for k, v in fields.items() if v is not None})


def planning_problem(number, goal, *, start=None):
    start = initial(5.0, yawRate=0.0, slipAngle=0.0) if start is None else start
    return f'<planningProblem id="{number}">{start}{goal}</planningProblem>'


def goal(*, position="", time=(0, 50), **values):
    position = f"<position>{position}</position>" if position else ""
    intervals = "".join(interval(name, *value) for name, value in {"time": time, **values}.items())
    return f"<goalState>{position}{intervals}</goalState>"


def saved(folder: Path, text, name="test.xml") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def driven(scenario, number=30):
    """Columns of one obstacle as a dictionary."""
    obstacles = scenario.obstacles
    row = obstacles.ids.tolist().index(number)
    names = ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid")
    return {name: getattr(obstacles, name)[row] for name in names}
