"""The three manoeuvres of UN R157 with a reference driver in the place of the system, over arrays of cases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from interdrive.array_types import Bools, Floats

#: The reference drivers, each with one line of explanation.
DRIVERS = {
    "cc": "competent and careful human driver (UN R157, Annex 4, Appendix 3)",
    "r157": "minimum of UN R157, paragraph 5.2.5.2; for cut-ins only",
    "rss": "Responsibility-Sensitive Safety (arXiv 1708.06374)",
    "fsm": "fuzzy safety model (Mattas et al. 2020)",
}


@dataclass(frozen=True)
class Endings:
    """How cases end with a driver; arrays of shape (cases,).

    Attributes:
        crash: Whether it hits the other vehicle.
        is_beside: Whether it is ahead of the other at the contact, which then comes from the side.
        impact_speed: How much faster it is at the contact [m/s]; nan without a contact.
        ttc_min: Least time to collision with a slower vehicle in its way [s]; inf without any.
    """

    crash: Bools
    is_beside: Bools
    impact_speed: Floats
    ttc_min: Floats


@dataclass(frozen=True)
class CutOuts(Endings):
    """How cut-outs and followings end with a driver; arrays of shape (cases,).

    Attributes:
        kept_distance: Gap to the leader at the start, which the driver chose [m].
        leader_crash: Whether the leader itself hits the standing vehicle; False in followings.
    """

    kept_distance: Floats
    leader_crash: Bools


def cut_in(
    driver: str, *, velocity: ArrayLike, other_velocity: ArrayLike, gap: ArrayLike, sideways: ArrayLike
) -> Endings:
    """A vehicle comes from the lane beside, 1.6 m away, and keeps its speed.

    The arguments are broadcast against each other. Both vehicles are 4.3 m long and 1.9 m wide; 35 s in steps of 0.1 s.

    Args:
        driver: One of `DRIVERS`.
        velocity: Speed of the driver [m/s].
        other_velocity: Speed of the other vehicle [m/s].
        gap: From bumper to bumper when the other has reached its sideways speed [m].
        sideways: Sideways speed of the other [m/s].

    Raises:
        InputError: There is no such driver, or a number is negative or not finite; the line names the case.
    """
    return Endings(**_core.drive_cut_ins(driver, *_columns(velocity, other_velocity, gap, sideways)))


def cut_out(driver: str, *, velocity: ArrayLike, front_distance: ArrayLike, sideways: ArrayLike) -> CutOuts:
    """The leader leaves the lane and reveals a standing vehicle.

    Args:
        driver: One of `DRIVERS` but `r157`, which is for cut-ins.
        velocity: Speed of driver and leader [m/s].
        front_distance: From the leader to the standing vehicle at the start [m].
        sideways: Sideways speed of the leader [m/s].

    Raises:
        InputError: As in `cut_in`, or the driver is `r157`.
    """
    _check_ahead(driver, "a cut-out")
    return CutOuts(**_core.drive_cut_outs(driver, *_columns(velocity, front_distance, sideways)))


def car_following(driver: str, *, velocity: ArrayLike, deceleration: ArrayLike) -> CutOuts:
    """The leader brakes to a halt.

    Args:
        driver: One of `DRIVERS` but `r157`, which is for cut-ins.
        velocity: Speed of driver and leader [m/s].
        deceleration: Of the leader, positive [m/s²].

    Raises:
        InputError: As in `cut_in`, or the driver is `r157`.
    """
    _check_ahead(driver, "car following")
    found = _core.drive_followings(driver, *_columns(velocity, deceleration))
    return CutOuts(**found, leader_crash=np.zeros(len(found["crash"]), dtype=np.bool_))


def _columns(*given: ArrayLike) -> tuple[Floats, ...]:
    try:
        columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(one, dtype=np.float64)) for one in given))
    except ValueError as error:
        raise InputError(f"the numbers of cases do not fit: {error}") from None
    return tuple(np.ascontiguousarray(column.ravel()) for column in columns)


def _check_ahead(driver: str, what: str) -> None:
    if driver == "r157":
        raise InputError(f"r157 is defined for cut-ins (UN R157, 5.2.5.2), not for {what}")
