"""Variations of rows: mirrored, with another measured speed, with a shorter past, with fewer neighbours.

Turning and moving are missing on purpose: features are local to the vehicle and do not change with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch

from interdrive import _core
from training.evenness import N_INSTANTS, with_evenness

if TYPE_CHECKING:
    from torch import Generator, Tensor

    Batch = dict[str, Tensor]

_INSTANT = 0.2
_COLUMN = {
    group: {entry[0]: i for i, entry in enumerate(_core.NEURAL[group])} for group in ("agent", "neighbours", "paths")
}
_SCALE = {group: {entry[0]: entry[1] for entry in _core.NEURAL[group]} for group in ("agent", "neighbours", "paths")}
_SIGN = {
    group: torch.tensor([entry[2] for entry in _core.NEURAL[group]], dtype=torch.float32)
    for group in ("agent", "neighbours", "paths")
}
_SWAPPED_COLUMNS = torch.tensor(_core.NEURAL["path_mirror_columns"])
_SWAPPED_SLOTS = torch.tensor(_core.NEURAL["mirror_slots"])


@dataclass(frozen=True)
class Augmentation:
    """How often and how much rows are varied.

    Attributes:
        mirrored: Share of rows that are mirrored.
        shortened: Share of rows whose past is cut at a random instant.
        forgetful: Share of neighbours that are left out.
        speed_noise: Standard deviation of the speed of moving vehicles, relative.
        jittery: Share of rows whose past is measured badly, as cameras do.
        human: Share of rows of simulated drivers (they keep to the middle of lanes and accelerate evenly) that are
            made to drive and be measured more like people.
        blind: Share of rows that lose each of: all neighbours, the second leader, the follower, crossing traffic.
        blurred: Share of rows whose paths are a little different, so that no place is known by its shape.
    """

    mirrored: float = 0.3
    shortened: float = 0.25
    forgetful: float = 0.05
    speed_noise: float = 0.01
    jittery: float = 0.0
    human: float = 0.6
    blind: float = 0.1
    blurred: float = 0.7


def augmented(batch: Batch, how: Augmentation, generator: Generator) -> Batch:
    """A varied copy of a batch."""
    n = len(batch["velocity"])
    batch = dict(batch)

    def chosen(share: float, *shape: int) -> Tensor:
        return torch.rand(shape or (n,), generator=generator) < share

    if how.mirrored:
        batch = _mixed(batch, mirrored(batch), chosen(how.mirrored))
    if how.human:
        batch = humanised(batch, chosen(how.human) & batch["simulated"] & (batch["velocity"] > 1.0), generator)
    if how.jittery:
        batch["agent"] = jittered(batch["agent"], chosen(how.jittery) & (batch["velocity"] > 1.0), generator)
    if how.shortened:
        instants = torch.randint(0, N_INSTANTS, (n,), generator=generator)
        batch["agent"] = shortened(batch["agent"], torch.where(chosen(how.shortened), instants, N_INSTANTS))
    if how.forgetful:
        kept = ~chosen(how.forgetful, n, batch["neighbours"].shape[1], 1)
        batch["neighbours"] = batch["neighbours"] * kept
    if how.blind:
        batch["neighbours"] = batch["neighbours"] * ~chosen(how.blind, n, 1, 1)
        for prefix in _GROUPS:
            batch["paths"] = without(batch["paths"], prefix, chosen(how.blind))
    if how.blurred:
        batch["paths"] = blurred(batch["paths"], chosen(how.blurred) & ~batch["steady"], generator)
    if how.speed_noise:
        noise = torch.randn(n, generator=generator) * how.speed_noise * batch["velocity"]
        batch = with_speed(batch, torch.where(batch["velocity"] > 1.0, noise, torch.zeros(n)))
    return {**batch, "agent": torch.from_numpy(with_evenness(batch["agent"].numpy()))}


def _mixed(batch: Batch, other: Batch, where: Tensor) -> Batch:
    return {
        name: torch.where(where.view(-1, *[1] * (values.dim() - 1)), other[name], values)
        for name, values in batch.items()
    }


def mirrored(batch: Batch) -> Batch:
    """Left and right change places."""
    out = dict(batch)
    for group in ("agent", "neighbours", "paths"):
        out[group] = batch[group] * _SIGN[group]
    out["paths"] = out["paths"][..., _SWAPPED_COLUMNS]
    for name in ("paths", "path_valid", "offset", "slope", "settling", "target"):
        out[name] = out[name][:, _SWAPPED_SLOTS]
    out["offset"], out["slope"] = -out["offset"], -out["slope"]
    out["target"] = out["target"] * torch.tensor([1.0, -1.0])
    return out


#: Standard deviations of what cameras measure badly: of instants of the past, and of the present.
_JITTER_PAST = {"past_x": 0.15, "past_y": 0.08, "past_velocity": 0.4}
_JITTER_NOW = {"acceleration_half_second": 0.6, "acceleration_second": 0.3, "yaw_rate": 0.03}


def jittered(agent: Tensor, chosen: Tensor, generator: Generator) -> Tensor:
    """Features of vehicles with errors of measurement in what is known of the past of the chosen ones, shape (b,)."""
    agent = agent.clone()
    size = torch.rand(len(agent), generator=generator) * chosen
    past = agent[:, : 4 * N_INSTANTS].view(-1, N_INSTANTS, 4)
    for i, (name, sigma) in enumerate(_JITTER_PAST.items()):
        noise = torch.randn(len(agent), N_INSTANTS, generator=generator) * sigma / _SCALE["agent"][f"{name}_0.2"]
        past[..., i] += noise * past[..., 3] * size[:, None]
    for name, sigma in _JITTER_NOW.items():
        column = agent[:, _COLUMN["agent"][name]]
        noise = torch.randn(len(agent), generator=generator) * sigma / _SCALE["agent"][name]
        column += noise * size * (column != 0)
    return agent


#: Standard deviations of what people do that simulated drivers do not: offset from the middle of the lane [m], heading
#: error [rad], acceleration over the next three seconds [m/s²].
_OFFSET, _HEADING, _ACCELERATION = 0.35, 0.02, 0.6


def humanised(batch: Batch, chosen: Tensor, generator: Generator) -> Batch:
    """Rows as if the chosen vehicles, shape (b,), were driven by people and measured by cameras."""
    out = dict(batch)
    n = len(chosen)

    def drawn(sigma: float) -> Tensor:
        return torch.randn(n, generator=generator) * sigma * chosen

    offset, heading, acceleration = drawn(_OFFSET), drawn(_HEADING), drawn(_ACCELERATION)
    column = _COLUMN["paths"]
    free = batch["paths"][..., column["is_free"]] > 0
    on_lane = batch["path_valid"] & ~free
    out["offset"] = batch["offset"] + offset[:, None] * on_lane
    out["slope"] = batch["slope"] + heading[:, None] * on_lane
    paths = batch["paths"].clone()
    paths[..., column["offset"]] += offset[:, None] * on_lane / _SCALE["paths"]["offset"]
    paths[..., column["heading_error"]] += heading[:, None] * on_lane / _SCALE["paths"]["heading_error"]
    out["paths"] = paths
    agent = jittered(batch["agent"], chosen, generator)
    past = agent[:, : 4 * N_INSTANTS].view(-1, N_INSTANTS, 4)
    ago = torch.arange(1, N_INSTANTS + 1) * _INSTANT
    # Only the heading is misjudged: the way that it came lies beside it now.
    past[..., 1] += past[..., 3] * (heading * batch["velocity"])[:, None] * ago / _SCALE["agent"]["past_y_0.2"]
    out["agent"] = agent
    knots = torch.tensor(_core.NEURAL["knots"], dtype=torch.float32)
    s, d = batch["target"][..., 0], batch["target"][..., 1]
    # Half of the offset is kept for three seconds; the speed never becomes negative.
    change = 0.5 * acceleration[:, None] * knots**2
    moved = torch.maximum(s + change[:, None], s * 0.5)
    s = torch.where((s > 0) & chosen[:, None, None], moved, s)
    kept = offset[:, None] * (1 - knots / 6.0)
    turned = heading[:, None] * knots * batch["velocity"][:, None] * free.any(dim=1, keepdim=True)
    d = d + torch.where(free[..., None], kept[:, None] - offset[:, None, None] - turned[:, None], kept[:, None])
    out["target"] = torch.stack([s, d], dim=-1)
    return out


def shortened(agent: Tensor, instants: Tensor) -> Tensor:
    """Features of vehicles whose past is known for a number of instants only, shape (b,); ten leave all as it is."""
    column = _COLUMN["agent"]
    agent = agent.clone()
    past = agent[:, : 4 * N_INSTANTS].view(-1, N_INSTANTS, 4)
    past *= (torch.arange(N_INSTANTS) < instants[:, None])[..., None]
    seconds = instants * _INSTANT
    is_short = instants < N_INSTANTS
    for name in ("seconds_known", "seconds_unmoved"):
        i = column[name]
        agent[:, i] = torch.where(is_short, torch.minimum(agent[:, i] * _SCALE["agent"][name], seconds), agent[:, i])
    for name, needed in (("acceleration_half_second", 0.5), ("yaw_rate", 0.5), ("acceleration_second", 1.0)):
        agent[:, column[name]] *= ~is_short | (seconds >= needed)
    return agent


#: What is on a path: beginnings of the names of its features.
_GROUPS = ("second", "follower", "crossing")


def without(paths: Tensor, prefix: str, chosen: Tensor) -> Tensor:
    """Paths on which there is nothing of a kind, as the core writes it, in the chosen rows, shape (b,)."""
    flag = paths[..., _COLUMN["paths"][f"has_{prefix}"]] > 0
    where = flag & chosen[:, None]
    paths = paths.clone()
    for name, column in _COLUMN["paths"].items():
        if name.startswith(prefix) or name == f"has_{prefix}":
            absent = _GAP_MAX / _SCALE["paths"][name] if name in _GAPS else 0.0
            paths[..., column] = paths[..., column].masked_fill(where, absent)
    return paths


#: Gaps and distances where there is no vehicle [m].
_GAP_MAX = 80.0
_GAPS = ("second_gap", "follower_gap", "crossing_distance")
#: Relative and absolute (after scaling) standard deviations of what a path looks like.
_BLUR = {
    **{f"curvature_{end}": (0.15, 0.02) for end in (5, 10, 15, 20, 30, 40, 60)},
    **{f"curve_speed_{end}": (0.1, 0.03) for end in (20, 40, 60)},
    "width": (0.06, 0.0),
    "road_end": (0.15, 0.0),
    "share": (0.05, 0.0),
    "leader_gap": (0.05, 0.0),
    "second_gap": (0.05, 0.0),
    "crossing_distance": (0.1, 0.0),
}


def blurred(paths: Tensor, chosen: Tensor, generator: Generator) -> Tensor:
    """Paths of the chosen rows, shape (b,), measured less exactly."""
    paths = paths.clone()
    for name, (relative, absolute) in _BLUR.items():
        column = paths[..., _COLUMN["paths"][name]]
        noise = torch.randn(column.shape, generator=generator) * chosen[:, None]
        column += noise * (relative * column.abs() + absolute * (column != 0))
    return paths


def with_speed(batch: Batch, change: Tensor) -> Batch:
    """As if the speed of the vehicle now had been measured differently by `change` [m/s], shape (b,)."""
    out = dict(batch)
    agent, neighbours, paths = (batch[group].clone() for group in ("agent", "neighbours", "paths"))
    change = torch.maximum(change, -batch["velocity"])
    past = agent[:, : 4 * N_INSTANTS].view(-1, N_INSTANTS, 4)
    ago = torch.arange(1, N_INSTANTS + 1) * _INSTANT
    known = past[..., 3]
    past[..., 0] += known * ago * change[:, None] / _SCALE["agent"]["past_x_0.2"]
    past[..., 2] -= known * change[:, None] / _SCALE["agent"]["past_velocity_0.2"]
    agent[:, _COLUMN["agent"]["velocity"]] += change / _SCALE["agent"]["velocity"]
    i = _COLUMN["neighbours"]["relative_velocity_x"]
    present = neighbours[..., _COLUMN["neighbours"]["is_present"]]
    neighbours[..., i] -= present * change[:, None] / _SCALE["neighbours"]["relative_velocity_x"]
    for name, flag in (("leader_relative_velocity", "has_leader"), ("follower_relative_velocity", "has_follower")):
        there = paths[..., _COLUMN["paths"][flag]]
        paths[..., _COLUMN["paths"][name]] -= there * change[:, None] / _SCALE["paths"][name]
    for name in ("curve_speed_20", "curve_speed_40", "curve_speed_60"):
        paths[..., _COLUMN["paths"][name]] -= batch["path_valid"] * change[:, None] / _SCALE["paths"][name]
    out.update(agent=agent, neighbours=neighbours, paths=paths, velocity=batch["velocity"] + change)
    return out
