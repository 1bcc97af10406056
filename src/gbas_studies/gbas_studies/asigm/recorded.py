"""The gradient monitor on recorded pairs of receivers: nothing there is a gradient, so all it sees is noise.

Double differences as the station makes them, of two receivers on surveyed antennas, against the sigma of the model that
a station has unless it is told another (:class:`~gbas_ground.monitors.carrier_noise.CarrierNoise`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import satellites_of
from gbas_core.signals import BANDS, L1
from gbas_ground.channels import ephemerides
from gbas_ground.channels.predicted_ranges import predict_ranges, site_of
from gbas_ground.channels.tracking import stack
from gbas_ground.monitors.double_difference import (
    Troposphere,
    carrier_residual_m,
    double_differences,
    reference_satellites,
)
from gbas_ground.monitors.gradient_coverage import gradient_site
from gbas_ground.monitors.ionosphere_gradient import (
    IonosphereGradientParams,
    by_baseline,
    check_ionosphere_gradient,
)
from gbas_msgs_py.joining import ReceptionQueue
from gbas_studies.ccd.recorded import MASK_RAD, PAIR_L1L2, PAIR_L1L5, RecordedSet, station_params
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Item, Picture, Section, Value
from gbas_studies.reproduction.registry import Options

SETS: Final = (PAIR_L1L2, PAIR_L1L5)
BINS_DEG: Final = (5.0, 10.0, 20.0, 30.0, 45.0, 90.0)
_TITLE: Final = "The monitor on recorded pairs"
_AIR: Final = Troposphere(refractivity=330.0, scale_height_m=7900.0)
_LEAST: Final = 100
"""Fewer double differences than this give no sigma. Ours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PairSeries:
    """One baseline over a recording; E epochs, two bands.

    Attributes
    ----------
    bands : tuple of int
    length_m : float
    residual_m, sigma_m : (E, 2, N) array
        Double differences and the model's sigma for them [m].
    statistic, threshold : (E, 2, N) array
        What was tested [m]; NaN where not.
    elevation_rad : (E, N) array
    failed : (E, N) bool array
        Satellites that the monitor failed.
    k_ffd : float
        Multiplier of the threshold of one band.
    """

    bands: tuple[int, ...]
    length_m: float
    residual_m: FloatArray
    sigma_m: FloatArray
    statistic: FloatArray
    threshold: FloatArray
    elevation_rad: FloatArray
    failed: BoolArray
    k_ffd: float


def pair_series(chosen: RecordedSet, data: Path, n_epochs: int | None = None) -> PairSeries:
    """Run the monitor over a recorded pair, elevation mask 5 degrees, nominal troposphere."""
    recording = chosen.open(data)
    station = station_params(chosen.antennas_m(recording))
    params = IonosphereGradientParams(runway_bearing_rad=(0.0,), carriers=("L1", BANDS[chosen.other]))
    site = gradient_site(station.receiver_positions_m(), station.reference_point_m(), params)
    where, known = site_of(station), ephemerides.initial_ephemerides()
    queue: ReceptionQueue[Ephemeris] = ReceptionQueue()
    for each in recording.ephemerides():
        queue.add(epoch_key(each.gps_week, each.tow_s), each)
    rows = []
    for number, epoch in enumerate(recording.epochs()):
        if n_epochs is not None and number >= n_epochs:
            break
        week, tow_s = from_epoch_key(epoch.key)
        for each in queue.take(epoch.key):
            known, _ = ephemerides.receive(known, each, week, tow_s, station)
        known, _, _ = ephemerides.choose(known, week, tow_s, station)
        raw = stack(epoch.ground, satellites_of("GE"))
        predicted = predict_ranges(known.current, week, tow_s, raw.code_m[:, L1], where)
        delay_m = _AIR.delay_m(predicted.elevation_rad, predicted.azimuth_rad, site.baselines.place_m)
        residual = carrier_residual_m(raw.carrier_m, predicted.range_m, predicted.clock_s, delay_m, params.bands)
        due = (predicted.elevation_rad >= MASK_RAD) & np.isfinite(residual[:, 0]).all(axis=0)
        references = reference_satellites(due, predicted.elevation_rad, params.references)
        made = double_differences(
            np.where(due, residual, np.nan),
            site.baselines,
            references,
            predicted.elevation_rad,
            params.noise,
            params.bands,
        )
        found = check_ionosphere_gradient(made, due, site, params)
        tested = by_baseline(found, made, site, params)
        rows.append(
            (
                made.residual_m[0], made.sigma_m[0], tested.statistic[0], tested.threshold[0],
                predicted.elevation_rad, found.verdict.failed,
            )
        )  # fmt: skip
    residual, sigma, statistic, threshold, elevation, failed = (np.array(each) for each in zip(*rows, strict=True))
    return PairSeries(
        residual_m=residual,
        sigma_m=sigma,
        statistic=statistic,
        threshold=threshold,
        elevation_rad=elevation,
        failed=failed,
        bands=params.bands,
        length_m=float(np.linalg.norm(site.baselines.vector_m)),
        k_ffd=site.tests[-1].k_ffd,
    )


# --- the study


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Double differences of a band between two elevations: how many, and their rms beside the model's [m]."""

    band: int
    low_deg: float
    high_deg: float
    count: int
    rms_m: float
    model_m: float
    normalised: float
    """Rms of each over its own sigma."""


def spreads(seen: PairSeries) -> list[Spread]:
    """By band and elevation, where there are enough of them."""
    degrees, result = np.degrees(seen.elevation_rad), []
    for place, band in enumerate(seen.bands):
        value, sigma = seen.residual_m[:, place], seen.sigma_m[:, place]
        for low, high in itertools.pairwise(BINS_DEG):
            inside = np.isfinite(value) & (degrees >= low) & (degrees < high)
            if inside.sum() < _LEAST:
                continue
            rms, model, normalised = (
                float(np.sqrt(np.mean(each[inside] ** 2))) for each in (value, sigma, value / sigma)
            )
            result.append(
                Spread(
                    band=band, low_deg=low, high_deg=high, count=int(inside.sum()), rms_m=rms, model_m=model,
                    normalised=normalised,
                )
            )  # fmt: skip
    return result


def recorded_section(options: Options) -> Section:
    """The monitor on recorded pairs; without recordings, a section that says so."""
    if options.data is None:
        return _left_out("No folder of recorded data was given (--data, or GBAS_DATA).")
    missing = [each.name for each in SETS if not each.exists(options.data)]
    if missing:
        return _left_out(f"Files are missing in the folder of recorded data: {'; '.join(missing)}.")
    items: list[Item] = []
    pictures = []
    for chosen in SETS:
        options.progress(chosen.name)
        seen = pair_series(chosen, options.data, 300 if options.quick else None)
        found = spreads(seen)
        items += _items(chosen.name, seen, found)
        pictures.append(_picture(chosen.name, f"recorded-{BANDS[chosen.other].lower()}", found))
    return Section(
        title=_TITLE,
        text="Not in the paper, which has no measurements. Two receivers with ordinary antennas on surveyed points and "
        "no gradient: the statistic is noise, multipath and what the survey is wrong by, against the middle one of up "
        "to five reference satellites, which is quieter than one. The model is the one a station has unless its file "
        "says otherwise; it was made from these recordings, so that this is no independent test of it.",
        items=items,
        pictures=pictures,
    )


def _left_out(why: str) -> Section:
    item = Claim(
        name="Recorded pairs", holds=None, paper_text="–", ours_text="–", definition="The monitor on recorded pairs.",
        why=why, new=True,
    )  # fmt: skip
    return Section(title=_TITLE, items=(item,))


def _items(name: str, seen: PairSeries, found: list[Spread]) -> list[Item]:
    tested = np.isfinite(seen.statistic).any(axis=1)
    alarms = int(seen.failed.sum())
    largest = float(np.nanmax(np.abs(seen.residual_m) / seen.sigma_m))
    worst = max(found, key=lambda each: each.normalised)
    return [
        *(
            Value(
                name=f"{name}: {BANDS[each.band]}, {each.low_deg:.0f} to {each.high_deg:.0f} degrees, rms over sigma",
                ours=each.normalised,
                unit="",
                definition=f"{each.count} double differences over {seen.length_m:.2f} m, "
                f"{each.rms_m * 1e3:.2f} mm rms; the model has {each.model_m * 1e3:.2f} mm",
            )
            for each in found
        ),
        Claim(
            name=f"{name}: the model bounds the measured sigma",
            holds=worst.normalised <= 1.0,
            paper_text="–",
            ours_text=f"largest ratio {worst.normalised:.2f}: {BANDS[worst.band]}, {worst.low_deg:.0f} to "
            f"{worst.high_deg:.0f} degrees",
            definition="rms of each double difference over its sigma, by band and elevation",
            why="" if worst.normalised <= 1.0 else "Multipath of these antennas is larger there.",
            new=True,
        ),
        Claim(
            name=f"{name}: no false alarm",
            holds=alarms == 0,
            paper_text="–",
            ours_text=f"{alarms} of {int(tested.sum())} satellites and epochs failed",
            definition="1e-8 in 15 s of one satellite, over its baseline and bands",
            why="" if alarms == 0 else "The model's sigma does not bound them.",
            new=True,
        ),
        Value(
            name=f"{name}: largest statistic over sigma",
            ours=largest,
            unit="",
            definition=f"any band and elevation, tested or not; the threshold is {seen.k_ffd:.2f} sigma",
        ),
    ]


def _picture(title: str, name: str, found: list[Spread]) -> Picture:
    figure = new_figure(height=3.6)
    axis = figure.axes[0]
    for number, band in enumerate(dict.fromkeys(each.band for each in found)):
        own = [each for each in found if each.band == band]
        middle = [0.5 * (each.low_deg + each.high_deg) for each in own]
        axis.plot(middle, [each.rms_m * 1e3 for each in own], f"C{number}o", label=f"{BANDS[band]}, measured")
        axis.plot(middle, [each.model_m * 1e3 for each in own], f"C{number}--", label=f"{BANDS[band]}, model")
    axis.set(xlabel="elevation [degrees]", ylabel="double difference [mm]", ylim=(0.0, None), title=title)
    axis.legend()
    columns = ("band", "low_deg", "high_deg", "rms_m", "model_m", "count")
    return Picture(
        name=name,
        title=title,
        caption="Recorded. Rms of the double differences by elevation, and the model's sigma for them.",
        figure=figure,
        data={column: np.array([getattr(each, column) for each in found], dtype=np.float64) for column in columns},
    )
