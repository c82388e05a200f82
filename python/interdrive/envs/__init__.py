"""Environments for reinforcement learning: one learner among planning traffic, or any subset of agents.

Example:
    >>> import gymnasium
    >>> import interdrive.envs  # registers the ids
    >>> env = gymnasium.make("interdrive/TJunction-v1")
"""

from __future__ import annotations

from interdrive.errors import MissingExtraError

try:
    import gymnasium
except ImportError as error:
    raise MissingExtraError('interdrive.envs needs gymnasium: pip install "interdrive[rl]"') from error

from interdrive.envs.actions import FrenetWeights, KinematicGrid
from interdrive.envs.parallel import ParallelDriveEnv, parallel_env
from interdrive.envs.policies import export_policy
from interdrive.envs.rows import Rows
from interdrive.envs.sampling import Hardest, Sampler, Uniform
from interdrive.envs.settings import EnvSettings
from interdrive.envs.single import DriveEnv
from interdrive.envs.stable_baselines import export_stable_baselines
from interdrive.envs.vector import DriveVectorEnv
from interdrive.native_settings import FrenetTarget, Kinematic, ObservationSettings, RewardWeights

__all__ = [
    "DriveEnv",
    "DriveVectorEnv",
    "EnvSettings",
    "FrenetTarget",
    "FrenetWeights",
    "Hardest",
    "Kinematic",
    "KinematicGrid",
    "ObservationSettings",
    "ParallelDriveEnv",
    "RewardWeights",
    "Rows",
    "Sampler",
    "Uniform",
    "export_policy",
    "export_stable_baselines",
    "parallel_env",
]

#: The planning problem that learns in the shipped scenarios.
_PROBLEM = 2001

#: Ids and what their environments are made with. A change of a default raises the version of all of them.
IDS: dict[str, dict[str, object]] = {
    "interdrive/Drive-v1": {},
    **{
        f"interdrive/{name}-v1": {"scenarios": scenario, "learners": [_PROBLEM], "traffic": "idm"}
        for name, scenario in (
            ("TJunction", "t_junction"),
            ("Merge", "lane_merge"),
            ("Highway", "highway"),
            ("Intersection", "intersection"),
        )
    },
}

for _id, _settings in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(
            _id,
            entry_point="interdrive.envs.single:DriveEnv",
            vector_entry_point="interdrive.envs.vector:DriveVectorEnv",
            kwargs=_settings,
        )
