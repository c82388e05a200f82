"""The native planners: the core plans for all their agents in one call."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from interdrive import _core
from interdrive.native_settings import (
    R157,
    Cc,
    Frenet,
    Fsm,
    Idm,
    IdmMobil,
    Lawful,
    Pdm,
    Rollout,
    Rss,
    VelocityAdjusting,
)
from interdrive.planners.policy import policy_planner


@dataclass(frozen=True)
class Recorded:
    """Replays the recording state by state; beyond its end it follows the lane with the last speed."""


@dataclass(frozen=True)
class Policy:
    """Drives by a policy that was learned.

    Attributes:
        file: The policy, as `interdrive.envs.export_policy` writes it.
    """

    file: str = ""


#: A record that is a choice of a native planner.
NativePlanner: TypeAlias = (
    Rollout | Frenet | Recorded | VelocityAdjusting | Idm | IdmMobil | Lawful | Pdm | Cc | R157 | Rss | Fsm
)


@dataclass(frozen=True)
class PlannerSettings:
    """Settings of all native planners.

    Attributes:
        rollout: Settings of `rollout`.
        frenet: Settings of `frenet`.
        velocity_adjusting: Settings of `velocity_adjusting`.
        idm: Settings of `idm`.
        idm_mobil: Settings of `idm_mobil`.
        lawful: Settings of `lawful`.
        pdm: Settings of `pdm`.
        cc: Settings of `cc`.
        r157: Settings of `r157`.
        rss: Settings of `rss`.
        fsm: Settings of `fsm`.
    """

    rollout: Rollout = field(default_factory=Rollout)
    frenet: Frenet = field(default_factory=Frenet)
    velocity_adjusting: VelocityAdjusting = field(default_factory=VelocityAdjusting)
    idm: Idm = field(default_factory=Idm)
    idm_mobil: IdmMobil = field(default_factory=IdmMobil)
    lawful: Lawful = field(default_factory=Lawful)
    pdm: Pdm = field(default_factory=Pdm)
    cc: Cc = field(default_factory=Cc)
    r157: R157 = field(default_factory=R157)
    rss: Rss = field(default_factory=Rss)
    fsm: Fsm = field(default_factory=Fsm)


#: Names of the native planners, each with one line of explanation.
NATIVE = {
    "rollout": "drives several ways ahead in closed loop and takes the cheapest",
    "frenet": "samples trajectories in the Frenet frame of the reference path and takes the cheapest safe one",
    "recorded": "replays the recording",
    "velocity_adjusting": "keeps the recorded path, and the recorded speed where the way is free",
    "idm": "drives its reference path with the Intelligent Driver Model",
    "lawful": "drives its reference path with the Intelligent Driver Model, as fast as is lawful",
    "pdm": "scores 15 proposals at shares of the speed limit and drives the best, after PDM-Closed",
    "policy": "drives by a policy that was learned, `policy,file=FILE`",
    "idm_mobil": "drives with the Intelligent Driver Model and changes lanes with MOBIL",
    "cc": "drives as the competent and careful human driver of UN R157",
    "r157": "drives with the least reaction that UN R157, 5.2.5.2, asks of a system",
    "rss": "drives by Responsibility-Sensitive Safety",
    "fsm": "drives by the fuzzy safety model",
}

#: Planners that need the recording of their agent.
RECORDED_PATH = ("recorded", "velocity_adjusting")

#: The record of each native planner.
RECORDS: dict[str, type] = {
    "rollout": Rollout,
    "frenet": Frenet,
    "recorded": Recorded,
    "velocity_adjusting": VelocityAdjusting,
    "idm": Idm,
    "idm_mobil": IdmMobil,
    "lawful": Lawful,
    "pdm": Pdm,
    "cc": Cc,
    "r157": R157,
    "rss": Rss,
    "fsm": Fsm,
    "policy": Policy,
}


def native_planner(record: object) -> _core.Planner | None:
    """The core's planner for a native record; None for a planner written in Python.

    Raises:
        InputError: The file of a policy is missing or damaged.
    """
    name = next((name for name, kind in RECORDS.items() if type(record) is kind), None)
    if isinstance(record, Policy):
        return policy_planner(record.file)
    return None if name is None else _core.Planner(name, record)
