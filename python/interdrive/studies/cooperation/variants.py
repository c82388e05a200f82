"""What the study of cooperation drives: scenarios and variants of cooperation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.files import FOLDER_VARIABLE, recorded_scenario, scenario_folders, shipped_scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.config.binding import Setting

#: Shipped scenarios, and files below the folder of recorded scenarios. Of each category the two with the most recorded
#: vehicles that can become agents, among files that last 3 s or longer and have at most 25 vehicles (in one category
#: only one has two or more); then four in which agents are known to wait for each other.
SHIPPED = ("t_junction", "lane_merge", "intersection")
RECORDED = (
    "highway/USA_US101-5_1_T-1.xml",
    "highway/USA_US101-4_1_T-1.xml",
    "intersection/USA_Lanker-1_1_T-1.xml",
    "intersection/USA_Peach-4_1_T-1.xml",
    "merge/ZAM-Ramp-1_1-T-1.xml",
    "merge/ZAM_Zip-1_56_T-1.xml",
    "overtaking/OSC_Overtake-1_1_T-1.xml",
    "t_junction/ZAM_Tjunction-1_102_T-1.xml",
    "t_junction/ZAM_Tjunction-1_1_T-1.xml",
    "urban/DEU_Muc-21_2_T-1.xml",
    "urban/CHN_Sha-9_2_T-1.xml",
    "vulnerable/RUS_Bicycle-10_1_T-1.xml",
    "vulnerable/RUS_Bicycle-3_1_T-1.xml",
    "t_junction/ZAM_Tjunction-1_42_T-1.xml",
    "urban/CHN_Sha-4_3_T-1.xml",
    "urban/CHN_Sha-12_1_T-1.xml",
    "urban/DEU_Muc-28_1_T-1.xml",
)

#: Settings of `interdrive study cooperation` unless told otherwise: orders at junctions leave nothing to negotiate.
WITHOUT_ORDERS: dict[str, Setting] = {"rules.precedence": False}

#: Shares of equipped agents with occlusion.
_HIDDEN_SHARES = (0.5, 1.0)
_SHARES, _DELAYS, _LOSSES = (0.25, 0.5, 0.75), (0.1, 0.2, 0.3, 0.5, 1.0), (0.1, 0.2, 0.3, 0.4, 0.5)


@dataclass(frozen=True)
class Variant:
    """One way to cooperate.

    Attributes:
        penetration: Share of equipped agents.
        negotiate: Agents agree which goes first.
        delay: Delay of messages [s].
        loss: Probability that a message is lost.
        occlusion: Agents do not see what vehicles hide.
        mcm: They send their plans.
        cpm: They send what they see.
    """

    penetration: float
    negotiate: bool = False
    delay: float = 0.0
    loss: float = 0.0
    occlusion: bool = False
    mcm: bool = True
    cpm: bool = False

    @property
    def name(self) -> str:
        """As one word, for tables."""
        parts = [f"{100 * self.penetration:.0f}%", *(["negotiate"] if self.negotiate else [])]
        parts += ["occlusion", *([self.services] if self.penetration > 0 else [])] if self.occlusion else []
        parts += [f"delay={self.delay:g}"] if self.delay else []
        return "_".join([*parts, *([f"loss={self.loss:g}"] if self.loss else [])])

    @property
    def services(self) -> str:
        """What is sent, as it is set."""
        return "+".join(["cam", *(["mcm"] if self.mcm else []), *(["cpm"] if self.cpm else [])])

    @property
    def is_drawn(self) -> bool:
        """Whether the seed matters."""
        return 0 < self.penetration < 1 or self.loss > 0

    @property
    def settings(self) -> dict[str, Setting]:
        """Settings of its runs."""
        names = ("penetration", "negotiate", "delay", "loss", "mcm", "cpm")
        values: dict[str, Setting] = {f"v2x.{name}": getattr(self, name) for name in names}
        return {**values, "view.occlusion": True} if self.occlusion else values


def cooperation_variants(*, quick: bool = False) -> tuple[Variant, ...]:
    """What is driven.

    Penetration with plans alone and with negotiation; delay and loss where all agents negotiate; and, with occlusion,
    penetration by services.
    """
    if quick:
        occluded = (Variant(0.0, occlusion=True), Variant(1.0, occlusion=True, cpm=True))
        return (Variant(0.0), Variant(1.0), Variant(1.0, negotiate=True), *occluded)
    shares = [Variant(share, negotiate) for share in (*_SHARES, 1.0) for negotiate in (False, True)]
    delays = [Variant(1.0, negotiate=True, delay=delay) for delay in _DELAYS]
    losses = [Variant(1.0, negotiate=True, loss=loss) for loss in _LOSSES]
    services = [(False, False), (True, False), (True, True)]
    hidden = [Variant(share, occlusion=True, mcm=mcm, cpm=cpm) for mcm, cpm in services for share in _HIDDEN_SHARES]
    return (Variant(0.0), *shares, *delays, *losses, Variant(0.0, occlusion=True), *hidden)


def cooperation_files(*, quick: bool = False) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """The scenarios of the study, and what the user should know about them.

    Recorded scenarios are looked for below the folders that the environment variable INTERDRIVE_SCENARIOS names.
    """
    shipped: Sequence[str] = SHIPPED[:1] if quick else SHIPPED
    files = [shipped_scenario(name) for name in shipped]
    folders = scenario_folders()
    if quick:
        return tuple(files), ()
    if not folders:
        return tuple(files), (f"{FOLDER_VARIABLE} names no folder: shipped scenarios only",)
    recorded = {name: recorded_scenario(name) for name in RECORDED}
    where = os.pathsep.join(map(str, folders))
    missing = [f"{Path(name).name}: not in {where}, left out" for name, path in recorded.items() if path is None]
    return (*files, *(path for path in recorded.values() if path is not None)), tuple(missing)
