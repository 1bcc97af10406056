"""The ionosphere on a quiet day: a thin shell whose vertical delay has a day, and a gradient drawn for each satellite.

The delay is that of the code on L1; it is opposite on the carrier and goes with the square of the wavelength
(:data:`gbas_core.signals.IONO_RATIO`). It is the vertical delay times the obliquity at each receiver's own pierce
point, see :mod:`gbas_sim.atmosphere.paths`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_sim.atmosphere.paths import Delay, SignalPaths

_STREAM: Final = 20  # second word of the generator's key
_DAY_S: Final = 86_400.0


@parameters
class IonosphereParams:
    """A quiet ionosphere.

    Known: a gradient of 4 mm/km is what stations broadcast at middle latitudes (Lee, Pullen, Datta-Barua, Enge, J.
    Aircraft 44 (2007), pp. 1662-1669). With the reference "baseline" the differential delay is the standard's: F_pp
    sigma_vig x; see :meth:`gbas_sim.atmosphere.paths.SignalPaths.along`.

    Source of the day: Klobuchar, IEEE Trans. AES-23 (1987), pp. 325-331; IS-GPS-200N 20.3.3.5.2.5: 5 ns at night, the
    height of the day at 14 h. The half cosine is taken whole, not as the message's series of three terms, so that the
    delay is continuous at its ends; amplitude and period are constants.
    """

    night_delay_m: Annotated[float, Parameter("vertical delay at night", "m", 0.0, 50.0)] = 1.5
    day_delay_m: Annotated[float, Parameter("what the day adds at its height", "m", 0.0, 100.0)] = 4.5
    peak_local_s: Annotated[float, Parameter("local solar time of the height of the day", "s", 0.0, _DAY_S)] = 50_400.0
    period_s: Annotated[
        float, Parameter("of the cosine whose positive half is the day", "s", 20_000.0, 2.0 * _DAY_S)
    ] = 100_800.0
    sigma_vig: Annotated[
        float,
        Parameter("standard deviation of each satellite's vertical gradient in any direction", "m/m", 0.0, 1.0e-3),
    ] = 4.0e-6
    gradient_reference: Annotated[
        Literal["baseline", "ray", "pierce"], Parameter("how the distance is measured over which the gradient acts")
    ] = "baseline"


@dataclass(frozen=True, kw_only=True)
class Ionosphere:
    """The quiet ionosphere of one world.

    Attributes
    ----------
    params : IonosphereParams
    seed : int
        Of the gradients.
    """

    params: IonosphereParams = IonosphereParams()
    seed: int = 0

    @cached_property
    def gradient(self) -> FloatArray:
        """Vertical gradient towards east and north of each satellite, (2, N_SATS) [m/m].

        Two independent normal numbers: in every direction the gradient has the standard deviation asked for.
        """
        generator = np.random.Generator(np.random.Philox(key=[self.seed, _STREAM]))
        return np.asarray(self.params.sigma_vig * generator.standard_normal((N_SATS, 2)).T)

    def delay(self, paths: SignalPaths) -> Delay:
        """Slant delay on L1 and its rate; NaN for satellites below the horizon."""
        vertical_m, vertical_mps = self._day(paths)
        for direction_rad, gradient in zip((0.5 * math.pi, 0.0), self.gradient, strict=True):
            distance_m, rate_mps = paths.along(direction_rad, self.params.gradient_reference)
            vertical_m = vertical_m + gradient * distance_m
            vertical_mps = vertical_mps + gradient * rate_mps
        obliquity = paths.shell.obliquity
        return Delay(
            delay_m=obliquity * vertical_m,
            rate_mps=obliquity * vertical_mps + paths.shell.obliquity_rate * vertical_m,
        )

    def _day(self, paths: SignalPaths) -> tuple[FloatArray, FloatArray]:
        """Vertical delay without gradient at the pierce points, and its rate."""
        params = self.params
        longitude_rad, longitude_radps = paths.pierce_longitude
        late_s = paths.each(paths.tow_s) + longitude_rad * (0.5 * _DAY_S / math.pi) - params.peak_local_s
        late_s = late_s - _DAY_S * np.round(late_s / _DAY_S)
        to_phase = 2.0 * math.pi / params.period_s
        phase = np.clip(late_s * to_phase, -0.5 * math.pi, 0.5 * math.pi)
        phase_rate = to_phase * (1.0 + longitude_radps * (0.5 * _DAY_S / math.pi))
        day = np.abs(phase) < 0.5 * math.pi
        vertical_m = params.night_delay_m + params.day_delay_m * np.cos(phase)
        return vertical_m, np.where(day, -params.day_delay_m * phase_rate * np.sin(phase), 0.0)
