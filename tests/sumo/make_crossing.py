"""Makes the crossings of these tests anew: two roads with and without traffic lights, and vehicles on their ways.

    python tests/sumo/make_crossing.py NETCONVERT

NETCONVERT is SUMO's program of that name (pip install eclipse-sumo). Net and routes are its own, the CommonRoad file is
what `interdrive convert` makes of the net, with a planning problem.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
#: Folders by SUMO's type of the junction.
TYPES = {"crossing": "traffic_light", "equal_crossing": "right_before_left"}
#: Half the length of the roads [m].
ARM = 120
NAMES = {"west": (-ARM, 0), "east": (ARM, 0), "south": (0, -ARM), "north": (0, ARM)}
NODES = "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, (x, y) in NAMES.items())
EDGES = "".join(
    f'<edge id="{start}_{end}" from="{start}" to="{end}" numLanes="1" speed="13.89"/>'
    for name in NAMES
    for start, end in ((name, "center"), ("center", name))
)
#: On every way straight on, and two ways to the left; by the time between two vehicles [s].
WAYS = (("west", "east", 7), ("east", "west", 8), ("south", "north", 6), ("north", "south", 9), ("south", "west", 15))
CONFIG = """<configuration>
    <input>
        <net-file value="crossing.net.xml"/>
        <route-files value="crossing.rou.xml"/>
    </input>
    <time>
        <begin value="0"/>
        <step-length value="0.1"/>
    </time>
</configuration>
"""
PROBLEM = """
  <planningProblem id="900">
    <initialState>
      <position><point><x>-100.0</x><y>-1.6</y></point></position>
      <orientation><exact>0.0</exact></orientation>
      <time><exact>0</exact></time>
      <velocity><exact>10.0</exact></velocity>
      <yawRate><exact>0.0</exact></yawRate>
      <slipAngle><exact>0.0</exact></slipAngle>
    </initialState>
    <goalState>
      <position>
        <rectangle>
          <length>40.0</length><width>3.2</width><orientation>0.0</orientation>
          <center><x>90.0</x><y>-1.6</y></center>
        </rectangle>
      </position>
      <time><intervalStart>0</intervalStart><intervalEnd>900</intervalEnd></time>
    </goalState>
  </planningProblem>
"""


def make(name: str, kind: str) -> None:
    """Makes the files of a folder."""
    folder = FOLDER / name
    folder.mkdir(exist_ok=True)
    net = folder / "crossing.net.xml"
    with tempfile.TemporaryDirectory() as made:
        nodes, edges = Path(made) / "a.nod.xml", Path(made) / "a.edg.xml"
        nodes.write_text(f'<nodes>{NODES}<node id="center" x="0" y="0" type="{kind}"/></nodes>')
        edges.write_text(f"<edges>{EDGES}</edges>")
        subprocess.run(
            [
                sys.argv[1], "-n", nodes, "-e", edges, "-o", net, "--offset.disable-normalization", "true",
                "--no-turnarounds", "true", "--tls.default-type", "static",
            ],
            check=True,
        )  # fmt: skip
    # Without the comment that states when and from which folder it was made.
    net.write_text(re.sub(r"<!--.*?-->\s*", "", net.read_text(), flags=re.DOTALL))
    flows = "".join(
        f'<flow id="{a}_{b}" type="car" begin="0" end="120" period="{every}" departSpeed="max">'
        f'<route edges="{a}_center center_{b}"/></flow>'
        for a, b, every in WAYS
    )
    # Drivers without lights are not all alike, so that seeds differ.
    sigma = "0" if kind == "traffic_light" else "0.5"
    car = f'<vType id="car" length="4.6" width="1.8" sigma="{sigma}"/>'
    (folder / "crossing.rou.xml").write_text(f"<routes>{car}{flows}</routes>\n")
    (folder / "crossing.sumocfg").write_text(CONFIG)
    roads = folder / "crossing.cr.xml"
    subprocess.run([sys.executable, "-m", "interdrive", "convert", net, "--out", roads, "--overwrite"], check=True)
    roads.write_text(roads.read_text().replace("</commonRoad>", f"{PROBLEM.strip()}\n</commonRoad>"))


def main() -> int:
    """Makes all files."""
    for name, kind in TYPES.items():
        make(name, kind)
    return 0


if __name__ == "__main__":
    sys.exit(main())
