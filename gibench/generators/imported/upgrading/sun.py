"""Direction to the sun, in the axes of Mitsuba 0.6: x is east, y up, z south.

Source: M. Blanco-Muriel et al., Computing the solar vector, Solar Energy 70(5), 2001 (the PSA algorithm, which is good
to half a minute of arc until 2015).
"""

from __future__ import annotations

import math

import numpy as np

from gibench.generators.parts import FloatArray

DEFAULTS: dict[str, float] = {
    "latitude": 35.6894,
    "longitude": 139.6917,
    "timezone": 9.0,
    "year": 2010.0,
    "month": 7.0,
    "day": 10.0,
    "hour": 15.0,
    "minute": 0.0,
    "second": 0.0,
}
"""Of Mitsuba 0.6: Tokyo, on a summer's afternoon. Degrees, and hours that local time is ahead of UTC."""

EARTH_RADIUS, ASTRONOMICAL_UNIT = 6371.01, 149597890.0
"""km, as the algorithm has them."""


def direction(
    *,
    latitude: float,
    longitude: float,
    timezone: float,
    year: float,
    month: float,
    day: float,
    hour: float,
    minute: float,
    second: float,
) -> FloatArray:
    """(3,) unit vector towards the sun."""
    hours = hour - timezone + (minute + second / 60) / 60
    y, m, d = int(year), int(month), int(day)
    # Days since noon of 1 January 2000; whole divisions go towards zero, as in Fliegel and van Flandern (1968).
    shift = int((m - 14) / 12)
    julian = (
        int(1461 * (y + 4800 + shift) / 4)
        + int(367 * (m - 2 - 12 * shift) / 12)
        - int(3 * int((y + 4900 + shift) / 100) / 4)
        + d
        - 32075
        - 0.5
        + hours / 24
    )
    elapsed = julian - 2451545.0
    omega = 2.1429 - 0.0010394594 * elapsed
    mean_longitude = 4.8950630 + 0.017202791698 * elapsed
    anomaly = 6.2400600 + 0.0172019699 * elapsed
    ecliptic = (
        mean_longitude
        + 0.03341607 * math.sin(anomaly)
        + 0.00034894 * math.sin(2 * anomaly)
        - 0.0001134
        - 0.0000203 * math.sin(omega)
    )
    obliquity = 0.4090928 - 6.2140e-9 * elapsed + 0.0000396 * math.cos(omega)
    ascension = math.atan2(math.cos(obliquity) * math.sin(ecliptic), math.cos(ecliptic)) % (2 * math.pi)
    declination = math.asin(math.sin(obliquity) * math.sin(ecliptic))
    greenwich = 6.6974243242 + 0.0657098283 * elapsed + hours
    angle = math.radians(15 * greenwich + longitude) - ascension
    phi = math.radians(latitude)
    zenith = math.acos(
        max(
            -1.0,
            min(
                1.0,
                math.cos(phi) * math.cos(angle) * math.cos(declination)
                + math.sin(declination) * math.sin(phi),
            ),
        )
    )
    azimuth = math.atan2(
        -math.sin(angle), math.tan(declination) * math.cos(phi) - math.sin(phi) * math.cos(angle)
    )
    zenith += EARTH_RADIUS / ASTRONOMICAL_UNIT * math.sin(zenith)
    return np.array(
        [math.sin(azimuth) * math.sin(zenith), math.cos(zenith), -math.cos(azimuth) * math.sin(zenith)]
    )
