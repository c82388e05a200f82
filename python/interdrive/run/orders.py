"""What agents are told before junctions and crosswalks, as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.run.arrays import ORDERS, Orders

if TYPE_CHECKING:
    from collections.abc import Mapping


def orders_of(waits: Mapping[str, Any]) -> Orders:
    """The record of what `_core.World.waits` tells."""
    return Orders(**{**waits, "kind": tuple(ORDERS[code] for code in waits["kind"].tolist())})
