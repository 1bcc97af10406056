"""The test bed at Braunschweig: receivers of table 1, their baselines and angles to the runway."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.record import FloatArray
from gbas_ground.monitors.gradient_detectability import projected_length_m
from gbas_studies.reproduction.items import Section, Value

RECEIVERS_ECEF_M: Final = np.array(
    [
        [3840619.039, 715604.228, 5024909.863],
        [3840835.113, 714861.969, 5024848.587],
        [3841202.939, 715429.959, 5024488.675],
    ]
)
"""RR1 to RR3. Source: table 1."""

FOURTH_ECEF_M: Final = np.array([3840640.493, 715530.528, 5024903.779])
"""The fourth receiver that the paper proposes, 77 m from RR1 towards RR2."""

RUNWAY_BEARING_DEG: Final = 84.73
"""True bearing of runway 08. Not in the paper; as in the suite's configuration of the site (course 264.73)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Testbed:
    """Geometry that follows from the positions.

    Attributes
    ----------
    enu_m : (3, 3) array
        Receivers from RR1, east, north, up, one row each [m].
    bearing_rad : float
        Of the runway [rad].
    """

    enu_m: FloatArray
    bearing_rad: float

    def length_m(self, first: int, second: int) -> float:
        """Length of a baseline; receivers count from 1 [m]."""
        return float(np.linalg.norm(self.enu_m[second - 1] - self.enu_m[first - 1]))

    def along_m(self, first: int, second: int) -> float:
        """Its length along the runway [m]."""
        return abs(float(projected_length_m(self.enu_m[second - 1] - self.enu_m[first - 1], self.bearing_rad)))

    def angle_rad(self, first: int, second: int) -> float:
        """Its angle to the runway, 0 to 90 degrees [rad]."""
        return math.acos(self.along_m(first, second) / self.length_m(first, second))

    @property
    def azimuth_12_rad(self) -> float:
        """Azimuth from RR1 to RR2 [rad]."""
        east, north, _ = self.enu_m[1]
        return math.atan2(east, north) % (2.0 * math.pi)

    @property
    def theta_rad(self) -> float:
        """Angle between the baselines to RR2 and RR3 [rad]."""
        cosine = self.enu_m[1] @ self.enu_m[2] / (self.length_m(1, 2) * self.length_m(1, 3))
        return math.acos(float(cosine))

    @property
    def existing_m(self) -> tuple[tuple[float, float], ...]:
        """East and north of the receivers, from RR1 [m]."""
        return tuple((float(east), float(north)) for east, north, _ in self.enu_m)


def braunschweig() -> Testbed:
    """The test bed of the paper."""
    lat_rad, lon_rad, _ = geodetic_from_ecef(RECEIVERS_ECEF_M[0])
    enu_m = (RECEIVERS_ECEF_M - RECEIVERS_ECEF_M[0]) @ rot_enu_ecef(lat_rad, lon_rad).T
    return Testbed(enu_m=enu_m, bearing_rad=math.radians(RUNWAY_BEARING_DEG))


def geometry_section(testbed: Testbed) -> Section:
    """Baselines and angles that follow from table 1."""
    lengths = [
        Value(
            name=f"Table 1, baseline RR{first}-RR{second}",
            paper=printed,
            ours=testbed.length_m(first, second),
            unit="m",
            kind="input",
            definition="distance of the positions of table 1",
            tolerance=10.0,
            why="The paper cuts its lengths to tens of metres.",
        )
        for first, second, printed in ((1, 3, "740"), (2, 3, "760"), (1, 2, "770"))
    ]
    angles = [
        ("azimuth RR1 to RR2", math.degrees(testbed.azimuth_12_rad), "in the horizon of RR1, from north"),
        ("beta", math.degrees(testbed.angle_rad(1, 2)), f"RR1-RR2 against the runway, {RUNWAY_BEARING_DEG} degrees"),
        ("theta", math.degrees(testbed.theta_rad), "between RR1-RR2 and RR1-RR3"),
        ("angle of RR1-RR3 to the runway", math.degrees(testbed.angle_rad(1, 3)), "from the vectors: theta + beta"),
        ("theta - beta, as in eq (4)", math.degrees(testbed.theta_rad - testbed.angle_rad(1, 2)), "as printed"),
    ]
    items = [Value(name=name, ours=value, unit="deg", definition=how, kind="input") for name, value, how in angles]
    return Section(
        title="Table 1: the receivers",
        text="The runway does not run between the two baselines from RR1 but outside, so that the baseline to RR3 "
        "makes theta + beta with it. Eq (4) has theta - beta.",
        items=[*lengths, *items],
    )
