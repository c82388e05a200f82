"""Transverse Mercator projection of geographic coordinates, on the ellipsoid of WGS 84.

Krueger's series in the third flattening to order four; see C. F. F. Karney, "Transverse Mercator with an accuracy of a
few nanometers", Journal of Geodesy 85 (2011), equations 9 to 12 and 35.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: Half axis [m] and flattening of WGS 84.
_A, _F = 6378137.0, 1.0 / 298.257223563
#: Scale on the central meridian, easting [m] there, and northing [m] of the equator in the south, of UTM.
_UTM_SCALE, _UTM_EASTING, _UTM_SOUTH = 0.9996, 500_000.0, 10_000_000.0

_N = _F / (2.0 - _F)
_ECCENTRICITY = math.sqrt(_F * (2.0 - _F))
_RADIUS = _A / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_SERIES = (
    _N / 2.0 - 2.0 * _N**2 / 3.0 + 5.0 * _N**3 / 16.0 + 41.0 * _N**4 / 180.0,
    13.0 * _N**2 / 48.0 - 3.0 * _N**3 / 5.0 + 557.0 * _N**4 / 1440.0,
    61.0 * _N**3 / 240.0 - 103.0 * _N**4 / 140.0,
    49561.0 * _N**4 / 161280.0,
)


def transverse_mercator(latitude: Floats, longitude: Floats, origin: tuple[float, float]) -> Floats:
    """Coordinates [m] about an origin: x to the east, y to the north, true to scale on the origin's meridian.

    Args:
        latitude: [degrees], shape (points,).
        longitude: [degrees], shape (points,).
        origin: Latitude and longitude [degrees] of (0, 0).

    Returns:
        Shape (points, 2).
    """
    found: Floats = _from_equator(latitude, longitude - origin[1]) - _from_equator(np.array([origin[0]]), np.zeros(1))
    return found


def utm(latitude: Floats, longitude: Floats, zone_at: tuple[float, float]) -> Floats:
    """UTM easting and northing [m] in the zone of a place; south of the equator if that place is.

    Args:
        latitude: [degrees], shape (points,).
        longitude: [degrees], shape (points,).
        zone_at: Latitude and longitude [degrees] of a place in the zone.

    Returns:
        Shape (points, 2).
    """
    false_origin = np.array([_UTM_EASTING, _UTM_SOUTH if zone_at[0] < 0.0 else 0.0])
    found: Floats = _UTM_SCALE * _from_equator(latitude, longitude - central_meridian(zone_at)) + false_origin
    return found


def central_meridian(place: tuple[float, float]) -> float:
    """Longitude [degrees] of the middle of the UTM zone of a place, with the exceptions of Norway and Svalbard."""
    latitude, longitude = place
    zone = int((longitude + 180.0) // 6.0) % 60 + 1
    if 56.0 <= latitude < 64.0 and 3.0 <= longitude < 12.0:
        zone = 32
    if 72.0 <= latitude < 84.0 and 0.0 <= longitude < 42.0:
        zone = 31 + 2 * int((longitude + 3.0) // 12.0)
    return 6.0 * zone - 183.0


def _from_equator(latitude: Floats, longitude: Floats) -> Floats:
    """Easting from a meridian and northing from the equator [m]; longitudes [degrees] count from that meridian."""
    sine, angle = np.sin(np.radians(latitude)), np.radians(longitude)
    # The tangent of the conformal latitude.
    tangent = np.sinh(np.arctanh(sine) - _ECCENTRICITY * np.arctanh(_ECCENTRICITY * sine))
    xi = np.arctan2(tangent, np.cos(angle))
    eta = np.arcsinh(np.sin(angle) / np.hypot(tangent, np.cos(angle)))
    north, east = xi.copy(), eta.copy()
    for order, factor in enumerate(_SERIES, 1):
        north += factor * np.sin(2 * order * xi) * np.cosh(2 * order * eta)
        east += factor * np.cos(2 * order * xi) * np.sinh(2 * order * eta)
    found: Floats = _RADIUS * np.column_stack((east, north))
    return found
