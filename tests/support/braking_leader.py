"""A vehicle behind another one that may brake, and the search of that and nothing else."""

from interdrive.failure_search import Space
from interdrive.testing import Car, straight_road, world

AGENT, LEADER = 101, 102
#: A leader that may brake, and nothing else.
BRAKING = Space(
    start_time=(0.0, 0.0),
    start_speed=(1.0, 1.0),
    driver=(),
    errors=("brakes",),
    error_share=0.5,
    error_time=(0.0, 4.0),
    sight=(80.0, 80.0),
    occlusion=0.0,
    perception=0.0,
    others=1,
)


def scenario(gap=30.0):
    """A car that follows another one at the same speed, so far behind [m]."""
    cars = [Car(AGENT, 20.0, velocity=12.0), Car(LEADER, 20.0 + gap, velocity=12.0)]
    return world(straight_road(400.0), cars=cars, steps=80)
