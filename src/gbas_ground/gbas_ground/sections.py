"""Sections of a station's file: what it is, what it claims, and how it works; monitors have sections of their own.

Where a parameter is part of the integrity claim, its default is the most conservative value the broadcast can carry, or
the one that withholds service, so that leaving it out is never optimistic.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Parameter, ParameterError, parameters
from gbas_core.satellites import SYSTEM_MASKS
from gbas_ground.claims.limits import MAX_DECORRELATION, MAX_M_EIG, MAX_Y_EIG_M
from gbas_msgs_py.products import PRODUCTS
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_vdb.transmission.burst import SLOT_NAMES

GCID_UNHEALTHY: Final = 7
RSDS_NONE: Final = 255
MAX_SIGMA_VIG: Final = 25.5e-6
"""Largest vertical ionosphere gradient sigma that a type 2 message carries [m/m]."""
SECOND_PRODUCTS: Final = tuple(product.name for product in PRODUCTS if product.optional)
"""Corrections that a station makes only where it is told to."""
Place = tuple[float, float, float]


@parameters
class StationSection:
    """What the type 2 message says of the station."""

    id: Annotated[str, Parameter("GBAS ID, 3 or 4 characters A-Z, 0-9")]
    latitude_rad: Annotated[float, Parameter("reference point", "deg", -90.0, 90.0)]
    longitude_rad: Annotated[float, Parameter("reference point", "deg", -180.0, 180.0)]
    height_m: Annotated[float, Parameter("reference point above the ellipsoid", "m", -1000.0, 20_000.0)]
    magnetic_variation_rad: Annotated[float, Parameter("positive east", "deg", -180.0, 180.0)] = 0.0
    gcid: Annotated[Literal[1, 2, 3, 4, 7], Parameter("continuity/integrity designator; 7 is unhealthy")] = 7
    rsds: Annotated[
        int, Parameter("reference station data selector, 0 to 48; 255: no positioning service", "-", 0, RSDS_NONE)
    ] = RSDS_NONE
    max_use_distance_m: Annotated[float, Parameter("D_max; 0 is unlimited", "m", 0.0, 510_000.0)] = 50_000.0
    systems: Annotated[str, Parameter("satellite systems corrected: G, E or GE")] = "G"

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Z0-9]{3,4}", self.id):
            raise ParameterError(f"id = {self.id!r} is not 3 or 4 characters of A-Z, 0-9")
        if 48 < self.rsds < RSDS_NONE:
            raise ParameterError(f"rsds = {self.rsds} is not within 0 to 48, or {RSDS_NONE}")
        if not self.systems or len(set(self.systems)) != len(self.systems) or set(self.systems) - set(SYSTEM_MASKS):
            raise ParameterError(f"systems = {self.systems!r} is not one of G, E, GE")


@parameters
class ReceiversSection:
    """The reference receivers: rr1, rr2, ... without a hole."""

    rr1_ecef_m: Annotated[Place, Parameter("antenna of reference receiver 1, ECEF", "m", -1e7, 1e7)]
    rr2_ecef_m: Annotated[Place | None, Parameter("antenna of reference receiver 2, ECEF", "m", -1e7, 1e7)] = None
    rr3_ecef_m: Annotated[Place | None, Parameter("antenna of reference receiver 3, ECEF", "m", -1e7, 1e7)] = None
    rr4_ecef_m: Annotated[Place | None, Parameter("antenna of reference receiver 4, ECEF", "m", -1e7, 1e7)] = None
    minimum: Annotated[int, Parameter("fewest receivers behind a broadcast correction", "-", 1, 4)] = 2

    def __post_init__(self) -> None:
        missing = [place is None for place in self._all()]
        count = missing.index(True) if True in missing else len(missing)
        if not all(missing[count:]):
            beyond = count + 1 + missing[count:].index(False)
            raise ParameterError(
                f"rr{beyond}_ecef_m has no place: receivers are rr1 to rr{MAX_REFERENCE_RECEIVERS}, without a gap"
            )
        if self.minimum > count:
            raise ParameterError(f"minimum = {self.minimum} is more than the {count} receivers there are")

    def _all(self) -> tuple[Place | None, ...]:
        return (self.rr1_ecef_m, self.rr2_ecef_m, self.rr3_ecef_m, self.rr4_ecef_m)

    @property
    def ecef_m(self) -> tuple[Place, ...]:
        """Antenna positions of the 1 to 4 receivers [m]."""
        return tuple(place for place in self._all() if place is not None)


@parameters
class AccuracySection:
    """Sigma of the corrections."""

    designator: Annotated[Literal["A", "B", "C"], Parameter("ground accuracy designator")] = "A"
    sigma_elevation_rad: Annotated[
        tuple[float, ...], Parameter("nodes of a measured sigma table, rising; empty: the designator", "deg", 0.0, 90.0)
    ] = ()
    sigma_m: Annotated[
        tuple[float, ...],
        Parameter("measured sigma of one receiver's 100 s correction at the nodes", "m", 0.001, 100.0),
    ] = ()
    inflation: Annotated[float, Parameter("factor on every sigma (tails, mean errors)", "-", 1.0, 100.0)] = 1.0
    inflation_iono: Annotated[
        float, Parameter("further factor on sigma_pr_gnd alone (anomalous ionosphere)", "-", 1.0, 100.0)
    ] = 1.0
    factor_30s: Annotated[float, Parameter("sigma of the 30 s corrections over the 100 s ones", "-", 1.0, 10.0)] = (
        math.sqrt(100.0 / 30.0)
    )
    curves: Annotated[
        str, Parameter("file with a table of curves for the second frequency; empty: that of the suite")
    ] = ""

    def __post_init__(self) -> None:
        if len(self.sigma_elevation_rad) != len(self.sigma_m):
            raise ParameterError("sigma_elevation_deg and sigma_m are not lists of one length")
        if (np.diff(self.sigma_elevation_rad) <= 0.0).any():
            raise ParameterError("sigma_elevation_deg does not rise")


@parameters
class SecondBandSection:
    """Corrections of a second frequency, L5 and E5a, in private messages; without products there are none.

    A satellite has them only while it is usable on L1, by whose code and carrier it is found, placed and monitored.
    """

    products: Annotated[
        tuple[str, ...], Parameter("corrections that are made and broadcast", choices=SECOND_PRODUCTS)
    ] = ()
    min_cn0_dbhz: Annotated[float, Parameter("lowest C/N0 of a channel in use", "dB-Hz", 0.0, 60.0)] = 30.0

    def __post_init__(self) -> None:
        if len(set(self.products)) != len(self.products):
            raise ParameterError(f"products = {', '.join(self.products)}: one of them twice")


@parameters
class AtmosphereSection:
    """Atmosphere at the site."""

    sigma_vert_iono_gradient: Annotated[float, Parameter("for the type 2 message", "m/m", 0.0, MAX_SIGMA_VIG)] = (
        MAX_SIGMA_VIG
    )
    sigma_vert_iono_gradient_d: Annotated[
        float, Parameter("for additional data block 3", "m/m", 0.0, MAX_SIGMA_VIG)
    ] = MAX_SIGMA_VIG
    refractivity: Annotated[float, Parameter("at the site", "N", 16.0, 781.0)] = 400.0
    refractivity_uncertainty: Annotated[float, Parameter("one sigma", "N", 0.0, 255.0)] = 255.0
    scale_height_m: Annotated[float, Parameter("of the troposphere", "m", 100.0, 25_500.0)] = 7900.0


@parameters
class EphemerisSection:
    """What is claimed of orbits, and when a new ephemeris is used."""

    p: Annotated[
        float,
        Parameter(
            "least decorrelation parameter of the type 1 message; 0: it follows from the station's ephemeris monitor",
            "m/m", 0.0, MAX_DECORRELATION,
        ),
    ] = 0.0  # fmt: skip
    p_d: Annotated[float, Parameter("the same of the type 11 message", "m/m", 0.0, MAX_DECORRELATION)] = 0.0
    external_monitor: Annotated[
        str,
        Parameter("what else monitors the orbits and supports p, which is then broadcast as it stands; empty: nothing"),
    ] = ""
    k_md_e_pos: Annotated[float, Parameter("positioning service", "-", 0.0, 12.75)] = 12.75
    k_md_e_c: Annotated[float, Parameter("service type C", "-", 0.0, 12.75)] = 12.75
    k_md_e_d: Annotated[float, Parameter("service type D", "-", 0.0, 12.75)] = 12.75
    settle_s: Annotated[float, Parameter("a new ephemeris is used this long after its reception", "s", 0.0, 180.0)] = (
        120.0
    )
    max_change_m: Annotated[
        float, Parameter("a new ephemeris further from the last one is not used", "m", 1.0, 100_000.0)
    ] = 250.0


@parameters
class GastDSection:
    """Service type D."""

    enabled: Annotated[bool, Parameter("broadcast type 11 messages and additional data block 3")] = False
    required: Annotated[
        bool,
        Parameter(
            "satellites that the gradient and the orbit monitor cannot judge are not used; false, for recorded data, "
            "only where the station says that it is not healthy"
        ),
    ] = True
    y_eig_m: Annotated[float, Parameter("ionospheric error at the station", "m", 0.0, MAX_Y_EIG_M)] = MAX_Y_EIG_M
    m_eig: Annotated[float, Parameter("its growth with distance", "m/m", 0.0, MAX_M_EIG)] = MAX_M_EIG

    @property
    def demands_monitors(self) -> bool:
        """Whether satellites without these monitors' judgement are not used."""
        return self.enabled and self.required


@parameters
class VdbSection:
    """The data broadcast."""

    slots: Annotated[str, Parameter("slots assigned, such as AB or ACEG")] = "A"
    authentication: Annotated[bool, Parameter("broadcast additional data block 4")] = False
    test: Annotated[bool, Parameter("mark every message as a test: no guidance from it")] = False
    period_frames: Annotated[int, Parameter("frames within which types 2 and 4 are sent", "-", 1, 20)] = 20
    occupancy_min: Annotated[float, Parameter("filled part of a burst when authenticated", "-", 0.0, 1.0)] = 0.95

    def __post_init__(self) -> None:
        if not self.slots or "".join(sorted(set(self.slots) & set(SLOT_NAMES))) != self.slots:
            raise ParameterError(f"slots = {self.slots!r} is not letters A to H, each once, in order")


@parameters
class SmoothingSection:
    """Carrier smoothing of the corrections."""

    tau_s: Annotated[
        tuple[float, float],
        Parameter("time constants of the two corrections; 0: no smoothing (tests only)", "s", 0.0, 1000.0),
    ] = (100.0, 30.0)
    settle_time_s: Annotated[
        float, Parameter("time a filter has to run before its output is used (docs/decisions/0002)", "s", 0.0, 3600.0)
    ] = 230.0
    max_gap_s: Annotated[float, Parameter("longest gap in the data a filter survives", "s", 0.1, 3600.0)] = 3.5


@parameters
class MonitorsSection:
    """Rules that all monitors share: what is corrected, what is excluded with them, and when it comes back."""

    elevation_mask_rad: Annotated[float, Parameter("lowest elevation corrected", "deg", 5.0, 60.0)] = math.radians(5.0)
    receiver_fault_channels: Annotated[
        int, Parameter("channels failing by B values, or by their ranges, that make the receiver the fault", "-", 1, 68)
    ] = 3
    readmission_time_s: Annotated[
        float, Parameter("time without a failing monitor before use again", "s", 0.0, 7200.0)
    ] = 60.0
    readmission_longest_s: Annotated[
        float,
        Parameter(
            "the time doubles with each further exclusion of the same thing, up to this; free for as long, and it is "
            "new", "s", 0.0, 86_400.0,
        ),
    ] = 960.0  # fmt: skip
    readmission_share: Annotated[
        float, Parameter("of a threshold that what is excluded has to stay below", "-", 0.1, 1.0)
    ] = 0.6
    min_common_satellites: Annotated[
        int, Parameter("fewest common satellites a constellation is corrected with", "-", 1, 36)
    ] = 3
    clock_weighting: Annotated[
        Literal["plain", "elevation"], Parameter("mean that removes a receiver's clock")
    ] = "plain"  # fmt: skip
