"""A search behind one vehicle that may brake, and nothing else."""

from interdrive.failure_search import Space

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
