"""The divergence monitors on recorded receivers, epoch by epoch, with the station's own slip tests and geometry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.io.recording import RecordedEpoch, Recording
from gbas_core.parameters import made_of
from gbas_core.ranging.divergence import DivergenceParams
from gbas_core.ranging.slips import ChannelObservations, SlipParams, initial_slips, slip_step
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS, satellites_of
from gbas_core.signals import BANDS, L1, L2, L5, N_BANDS, SPEED_OF_LIGHT_MPS
from gbas_ground.channels import ephemerides as station_ephemerides
from gbas_ground.channels.predicted_ranges import predict_ranges, site_of
from gbas_ground.channels.tracking import stack
from gbas_ground.monitors.ccd import CcdParams, ccd_step, initial_ccd
from gbas_ground.monitors.ccd_f import TwoFrequencyInput, TwoFrequencyParams, initial_two_frequency, two_frequency_step
from gbas_ground.monitors.divergence_covariance import Calibration, StatisticCovariance, calibrate
from gbas_ground.monitors.divergence_forms import full_rank_form
from gbas_ground.params import GroundParams
from gbas_msgs_py.joining import ReceptionQueue

ALL: Final = slice(None)
MASK_RAD: Final = np.radians(5.0)


@dataclass(frozen=True, kw_only=True)
class RecordedSet:
    """Files of some receivers that observed together, below the folder of recorded data.

    Attributes
    ----------
    name : str
    ground, navigation : tuple of str
    positions_m : tuple of (x, y, z)
        Antennas, ECEF [m]; empty: those of the files' headers.
    other : int
        Second band.
    galileo : str
        Galileo message to read.
    simulated : bool
        By a hardware simulator.
    """

    name: str
    ground: tuple[str, ...]
    navigation: tuple[str, ...]
    positions_m: tuple[tuple[float, float, float], ...] = ()
    other: int = L5
    galileo: str = "inav"
    simulated: bool = False

    def exists(self, data: Path) -> bool:
        """Whether all files are there."""
        return all((data / name).exists() for name in (*self.ground, *self.navigation))

    def open(self, data: Path) -> Recording:
        """Read the files."""
        ground, navigation = ([data / name for name in names] for names in (self.ground, self.navigation))
        return Recording.open(ground, None, navigation, galileo=self.galileo)

    def antennas_m(self, recording: Recording) -> FloatArray:
        """(R, 3) [m]."""
        if self.positions_m:
            return np.array(self.positions_m)
        return np.array([file.approx_position_m for file in recording.ground])


_PAIR: Final = "static_pair_L1L5_2024"
_UPC: Final = "static_pair_L1L2_1h_2010"
_SPIRENT: Final = "spirent_L1L5_2023"
PAIR_L1L5: Final = RecordedSet(
    name="two receivers 1 m apart, L1/L5 and E1/E5a, 5 min",
    ground=(f"{_PAIR}/base.obs.gz", f"{_PAIR}/rover.obs.gz"),
    navigation=(f"{_PAIR}/base.nav.gz",),
    positions_m=((-3817681.1213, 3562839.4311, 3650159.1593), (-3817681.3807, 3562839.9785, 3650158.3760)),
)
SINGLE_L1L5: Final = RecordedSet(
    name="one receiver, L1/L5 and E1/E5a, 15 min",
    ground=("static_single_L1L5_2021/SEPT078M.21O.gz",),
    navigation=("static_single_L1L5_2021/SEPT078M.21P.gz",),
)
SPIRENT_L1L5: Final = RecordedSet(
    name="hardware simulator, L1/L5 and E1/E5a, 10 min",
    ground=(f"{_SPIRENT}/iono-Klob_tropo-Saast_Base-static_MO_Spirent.obs.gz",),
    navigation=(f"{_SPIRENT}/RINEX_GN_Spirent.23N", f"{_SPIRENT}/RINEX_EN_Spirent.23L"),
    positions_m=((4157177.06580187, 671230.476590636, 4774767.03105544),),
    galileo="fnav",
    simulated=True,
)
PAIR_L1L2: Final = RecordedSet(
    name="two receivers 38 m apart, L1/L2, 1 h",
    ground=(f"{_UPC}/UPC10770.11o.gz", f"{_UPC}/UPC20770.11o.gz"),
    navigation=(f"{_UPC}/brdc0770.11n.gz",),
    positions_m=((4789013.0077, 176610.1555, 4195034.8091), (4789031.3107, 176583.4025, 4195015.1106)),
    other=L2,
)
ONE_SECOND_SETS: Final = (PAIR_L1L5, SINGLE_L1L5, SPIRENT_L1L5, PAIR_L1L2)


def _storm(station: str, day: str, name: str) -> RecordedSet:
    return RecordedSet(
        name=name,
        ground=(f"storm_2003/{station}{day}0.03o.gz",),
        navigation=(f"storm_2003/brdc{day}0.03n.gz",),
        other=L2,
    )


STORM_SETS: Final = (
    _storm("garl", "303", "GARL, 30 October 2003 (storm)"),
    _storm("amc2", "303", "AMC2, 30 October 2003 (storm)"),
    _storm("garl", "301", "GARL, 28 October 2003"),
    _storm("garl", "305", "GARL, 1 November 2003"),
)
# 30 s data let nothing be filtered with tau = 30 s. Ten epochs a time constant are the least that averages anything;
# the settle time is the 6.9 tau of gbas_core.ranging.divergence, and one missing epoch is bridged.
STORM_FILTERS: Final = DivergenceParams(tau_s=300.0, max_gap_s=65.0, settle_s=2070.0)
# As long as the sets of a few minutes allow: 6.9 tau instead of the paper's 360 s.
SHORT_SETTLE: Final = DivergenceParams(tau_s=30.0, settle_s=207.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitoredSeries:
    """What the monitors saw; E epochs.

    Attributes
    ----------
    time_s : (E,) array
        Since the first epoch [s].
    single_mps : (E, R, N_BANDS, N) array
        Filtered code-minus-carrier rates, where they count [m/s].
    single_rate_mps : (E, R, N_BANDS, N) array
        The same before filtering.
    double_mps : (E, R, 3, N) array
        Filtered DF, DF of the other band and IF carrier, where each counts [m/s].
    double_rate_mps : (E, R, 3, N) array
        The same before filtering.
    published, full_rank : (E, N) array
        Test metrics where satellites are monitored [-].
    single_mean_mps : (E, N_BANDS, N) array
        Means over receivers [m/s].
    elevation_rad : (E, N) array
    clock_satellites : (E, N) array
    alarms : dict of str to (E, N) bool array
        ``"gast-d L1"`` and so on, ``"gast-f-paper"``, ``"gast-f-sound"``.
    epochs_lost : int
        Intervals longer than the median one.
    """

    time_s: FloatArray
    single_mps: FloatArray
    single_rate_mps: FloatArray
    double_mps: FloatArray
    double_rate_mps: FloatArray
    published: FloatArray
    full_rank: FloatArray
    single_mean_mps: FloatArray
    elevation_rad: FloatArray
    clock_satellites: FloatArray
    alarms: dict[str, BoolArray]
    epochs_lost: int

    def metric(self, covariance: StatisticCovariance) -> FloatArray:
        """The sound form's test metric with another covariance, (E, N) [-]."""
        complete = np.asarray(np.isfinite(self.double_mps).all(axis=2) & np.isfinite(self.full_rank)[:, np.newaxis])
        receivers = complete.sum(axis=1)
        total = np.where(complete[:, :, np.newaxis], self.double_mps, 0.0).sum(axis=1)
        mean = np.where(receivers[:, np.newaxis] > 0, total / np.maximum(receivers, 1)[:, np.newaxis], np.nan)
        each = zip(mean, self.elevation_rad, receivers, self.clock_satellites, strict=True)
        return np.array([full_rank_form(x, covariance.at(place, count, n)) for x, place, count, n in each])

    def calibrated(self, tau_s: float, chosen: slice | BoolArray = ALL, *, bins: int = 5) -> Calibration:
        """Covariance from the epochs `chosen`, with so many bins of elevation holding about as many samples each."""
        values = np.where(np.isfinite(self.full_rank)[:, np.newaxis, np.newaxis], self.double_mps, np.nan)[chosen]
        elevation = self.elevation_rad[chosen]
        complete = np.asarray(np.isfinite(values).all(axis=2))
        there = elevation[complete.any(axis=1)]
        edges = np.quantile(there, np.linspace(0.0, 1.0, bins + 1))
        edges[-1] = np.nextafter(edges[-1], np.inf)
        return calibrate(
            values, elevation, clock_satellites=self.clock_satellites[chosen], interval_s=self.interval_s, tau_s=tau_s,
            edges_rad=edges,
        )  # fmt: skip

    @property
    def interval_s(self) -> float:
        """Median interval [s]."""
        return float(np.median(np.diff(self.time_s)))


def monitor_set(
    chosen: RecordedSet, data: Path, filters: DivergenceParams, *, double: TwoFrequencyParams | None = None
) -> MonitoredSeries:
    """Run both monitors over a recorded set, receivers averaged, elevation mask 5 degrees."""
    recording = chosen.open(data)
    params = replace(double or TwoFrequencyParams(), other_band="L2" if chosen.other == L2 else "L5", filters=filters)
    return monitor_epochs(
        recording.epochs(), recording.ephemerides(), chosen.antennas_m(recording), CcdParams(filters=filters), params
    )


def monitor_epochs(
    epochs: Iterable[RecordedEpoch],
    ephemerides: Sequence[Ephemeris],
    antennas_m: FloatArray,
    single: CcdParams,
    double: TwoFrequencyParams,
) -> MonitoredSeries:
    """Run both monitors over epochs of any origin.

    Parameters
    ----------
    epochs : iterable of RecordedEpoch
        In order.
    ephemerides : sequence of Ephemeris
        As received; without any there is no IF carrier, and what needs it is not monitored.
    antennas_m : (R, 3) array
        ECEF [m].
    single, double
        Settings of the monitors.
    """
    observer = Observer(ephemerides, antennas_m, single.filters.max_gap_s)
    return _Run(observer, len(antennas_m), single, double).over(epochs)


class Observer:
    """Turns epochs into what the monitors are given: geometry, slips and masks as a station makes them.

    Parameters
    ----------
    ephemerides : sequence of Ephemeris
        As received.
    antennas_m : (R, 3) array
        ECEF [m].
    max_gap_s : float
        Longest interval over which slips are looked for [s].
    """

    def __init__(self, ephemerides: Sequence[Ephemeris], antennas_m: FloatArray, max_gap_s: float) -> None:
        count = len(antennas_m)
        self._station = station_params(antennas_m)
        self._site = site_of(self._station)
        self._known = station_ephemerides.initial_ephemerides()
        self._queue: ReceptionQueue[Ephemeris] = ReceptionQueue()
        for each in ephemerides:
            self._queue.add(epoch_key(each.gps_week, each.tow_s), each)
        self._slips, self._present = initial_slips(count), np.zeros((count, N_BANDS, N_SATS), dtype=bool)
        self._params = SlipParams(max_gap_s=max_gap_s, follow_code_steps=True)

    def see(self, epoch: RecordedEpoch, dt_s: float, failed: BoolArray) -> TwoFrequencyInput:
        """The next epoch; satellites that `failed` are not in the receivers' clocks."""
        week, tow_s = from_epoch_key(epoch.key)
        for each in self._queue.take(epoch.key):
            self._known, _ = station_ephemerides.receive(self._known, each, week, tow_s, self._station)
        self._known, changed, _ = station_ephemerides.choose(self._known, week, tow_s, self._station)
        raw = stack(epoch.ground, satellites_of("GE"))
        predicted = predict_ranges(self._known.current, week, tow_s, raw.code_m[:, L1], self._site)
        range_m = np.where(changed, np.nan, predicted.range_m - SPEED_OF_LIGHT_MPS * predicted.clock_s)
        observed = ChannelObservations(raw.code_m, raw.carrier_m, raw.doppler_hz, raw.lli, range_m)
        self._slips, found = slip_step(self._slips, observed, dt_s, self._params)
        # A channel that was away is not protected by the slip tests: it starts anew, as its smoothing filter does.
        present = np.isfinite(raw.code_m + raw.carrier_m)
        returned = present & ~self._present
        self._present = present
        high = np.where(np.isfinite(predicted.elevation_rad), predicted.elevation_rad >= MASK_RAD, True)
        used = np.broadcast_to(high, raw.code_m[:, 0].shape).copy()
        return TwoFrequencyInput(
            code_m=raw.code_m,
            carrier_m=found.carrier_m,
            restarted=found.slipped | returned,
            range_m=predicted.range_m,
            clock_s=predicted.clock_s,
            rebased=changed,
            elevation_rad=predicted.elevation_rad,
            used=used,
            clock_used=used & ~failed,
        )


class _Run:
    """Both monitors; a second pair of them without filters gives the rates before filtering."""

    def __init__(self, observer: Observer, n_receivers: int, single: CcdParams, double: TwoFrequencyParams) -> None:
        self._observer = observer
        raw = replace(single.filters, tau_s=1e-6, settle_s=0.0)
        self._params = ((single, double), (replace(single, filters=raw), replace(double, filters=raw)))
        self._states = [(initial_ccd(n_receivers), initial_two_frequency(n_receivers)) for a, b in self._params]
        self._failed = np.zeros(N_SATS, dtype=bool)

    def over(self, epochs: Iterable[RecordedEpoch]) -> MonitoredSeries:
        """What the monitors said at each epoch, in order."""
        rows: list[dict[str, NDArray[np.generic]]] = []
        keys: list[int] = []
        for epoch in epochs:
            dt_s = (epoch.key - keys[-1]) / 1000.0 if keys else float("nan")
            keys.append(epoch.key)
            rows.append(self._step(self._observer.see(epoch, dt_s, self._failed), dt_s))
        values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        time_s = (np.array(keys) - keys[0]) / 1000.0
        names = [name for name in values if name.startswith("gast")]
        alarms = {name: values.pop(name) for name in names}
        gaps = np.diff(time_s)
        lost = int((gaps > 1.5 * np.median(gaps)).sum())
        return MonitoredSeries(time_s=time_s, alarms=alarms, epochs_lost=lost, **values)

    def _step(self, seen: TwoFrequencyInput, dt_s: float) -> dict[str, NDArray[np.generic]]:
        results = []
        for place, (single, double) in enumerate(self._params):
            before = self._states[place]
            first, one = ccd_step(before[0], seen, dt_s, single)
            second, two = two_frequency_step(before[1], seen, dt_s, double)
            self._states[place] = (first, second)
            results.append((one, two))
        (one, two), (raw_one, raw_two) = results
        self._failed = two.full_rank.failed
        double = self._params[0][1]
        counts = one.settled & seen.used[:, np.newaxis]
        both = (counts[:, double.band] & counts[:, double.other])[:, np.newaxis]
        return {
            "single_mps": np.where(counts, one.receiver_mps, np.nan),
            "single_rate_mps": np.where(counts, raw_one.receiver_mps, np.nan),
            "double_mps": np.where(both, two.receiver_mps.swapaxes(0, 1), np.nan),
            "double_rate_mps": np.where(both, raw_two.receiver_mps.swapaxes(0, 1), np.nan),
            "published": two.published.statistic,
            "full_rank": two.full_rank.statistic,
            "single_mean_mps": one.mean_mps,
            "elevation_rad": seen.elevation_rad,
            "clock_satellites": two.clock_satellites,
            **{f"gast-d {name}": one.satellites.failed[band] for band, name in enumerate(BANDS)},
            "gast-f-paper": two.published.failed,
            "gast-f-sound": two.full_rank.failed,
        }


def station_params(antennas_m: FloatArray) -> GroundParams:
    """A station at recorded antennas; only its geometry and its handling of ephemerides are used here."""
    latitude, longitude, height = (float(value) for value in geodetic_from_ecef(antennas_m[0]))
    places = {f"receivers.rr{number}_ecef_m": place for number, place in enumerate(antennas_m.tolist(), start=1)}
    return made_of(
        GroundParams,
        {
            "station.id": "STDY",
            "station.latitude_rad": latitude,
            "station.longitude_rad": longitude,
            "station.height_m": height,
            "station.gcid": 1,
            "receivers.minimum": 1,
            "vdb.slots": "AB",
            "ephemeris.settle_s": 0.0,
            **places,
        },
    )
