"""Doppler and C/N0 of a recorded receiver against what is computed for it; the paper has no measurements of them."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gbas_core.gnss.ephemeris import EphemerisStore
from gbas_core.gnss.frames import azimuth_elevation, ecef_from_geodetic, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import rotated_range, transmit_state
from gbas_core.io.rinex import ObservationFile, read_navigation, read_observations
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signal.doppler import doppler_hz
from gbas_core.signal.link_budget import TransmitBudget
from gbas_core.signals import BANDS, L1, L2, L5, WAVELENGTH_M
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section
from gbas_studies.reproduction.registry import Options

_SET: Final = "static_pair_L1L5_2024"
_LIMIT_HZ: Final = 0.5
_LOWEST_RAD: Final = np.radians(5.0)
_NEW = "–"


class _Computed(NamedTuple):
    """A still receiver: what it observed, and Doppler and elevations computed for its known place."""

    observed: ObservationFile
    doppler_hz: FloatArray
    elevation_rad: FloatArray


def recorded_section(options: Options) -> Section:
    """Five minutes of a still receiver with L1, L2 and L5."""
    title = "Recorded: Doppler, rate of the carrier, C/N0 by elevation"
    if options.data is None or not (options.data / _SET).is_dir():
        left_out = Claim(
            name="Doppler of a recorded receiver",
            holds=None,
            paper_text=_NEW,
            ours_text=_NEW,
            definition=_NEW,
            why=f"No folder of recorded data with {_SET}.",
            new=True,
        )
        return Section(title=title, items=[left_out])
    computed = _computed(options.data / _SET)
    return Section(
        title=title,
        text="A still receiver of known place; its clock's drift, common to all satellites of an epoch, is taken off.",
        items=[*_doppler_items(computed), *_cn0_items(computed)],
        pictures=[_cn0_picture(computed)],
    )


def _computed(folder: Path) -> _Computed:
    observed = read_observations(folder / "base.obs.gz")
    week, tow_s = observed.first
    store = EphemerisStore()
    for ephemeris in read_navigation(folder / "base.nav.gz").received(week, tow_s):
        store = store.add(ephemeris)
    lat_deg, lon_deg, height_m = (float(each) for each in (folder / "base_position.txt").read_text().split())
    place = ecef_from_geodetic(np.radians(lat_deg), np.radians(lon_deg), height_m)
    places = np.broadcast_to(place, (len(observed), 3))
    ephemeris = store.usable(week, tow_s, 0.0)
    state = transmit_state(ephemeris, week, observed.tow_s[:, np.newaxis], observed.code_m[:, L1])
    lat, lon, _ = geodetic_from_ecef(place)
    _, los = rotated_range(places, state.position_m)
    return _Computed(
        observed=observed,
        doppler_hz=doppler_hz(places, np.zeros((len(observed), 3)), state),
        elevation_rad=azimuth_elevation(rot_enu_ecef(lat, lon) @ los)[1][0],
    )


def _doppler_items(computed: _Computed) -> list[Claim]:
    observed = computed.observed
    wavelengths = WAVELENGTH_M[:, np.newaxis]
    steps_s = np.diff(observed.tow_s)[:, np.newaxis, np.newaxis]
    middle = 0.5 * (computed.doppler_hz[1:] + computed.doppler_hz[:-1])
    both = {
        "Doppler": observed.doppler_hz - computed.doppler_hz,
        "rate of the carrier": -np.diff(observed.carrier_m, axis=0) / wavelengths / steps_s - middle,
    }
    high = computed.elevation_rad > _LOWEST_RAD
    return [
        _residual_item(f"{name}, {BANDS[band]}", residual[:, band], high)
        for name, residual in both.items()
        for band in (L1, L2, L5)
    ]


def _residual_item(name: str, residual_hz: FloatArray, high: BoolArray) -> Claim:
    """One band's, (E, N_SATS)."""
    left = residual_hz - np.nanmedian(residual_hz, axis=1, keepdims=True)
    rms_hz, high_hz = (float(np.sqrt(np.nanmean(each**2))) for each in (left, left[:, high]))
    return Claim(
        name=name,
        holds=rms_hz < _LIMIT_HZ,
        paper_text=_NEW,
        ours_text=f"{rms_hz:.3f} Hz rms of {int(np.isfinite(left).any(axis=0).sum())} satellites, "
        f"{high_hz:.3f} above 5°",
        definition="recorded less computed, rms below 0.5 Hz, all satellites the receiver reports",
        why="0.5 Hz or more.",
        new=True,
    )


def _levels_dbhz(computed: _Computed, band: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Recorded and expected C/N0 (N_SATS,), and satellites above 5 degrees that have both."""
    recorded = np.ma.masked_invalid(computed.observed.cn0_dbhz[:, band]).mean(axis=0).filled(np.nan)
    elevation = np.broadcast_to(computed.elevation_rad, (N_SATS,))
    expected = TransmitBudget(antenna="patch", beam="flat").cn0_dbhz(elevation)[band]
    return recorded, expected, np.isfinite(recorded) & np.isfinite(expected) & (elevation > _LOWEST_RAD)


def _cn0_items(computed: _Computed) -> list[Claim]:
    items = []
    for band in (L1, L5):
        recorded, expected, used = _levels_dbhz(computed, band)
        offset_db = float(np.mean((recorded - expected)[used]))
        spread_db = float(np.std((recorded - expected)[used]))
        slope = float(np.polyfit(expected[used], recorded[used], 1)[0])
        items.append(
            Claim(
                name=f"C/N0 by elevation, {BANDS[band]}",
                holds=spread_db < 3.0 and slope > 0.0,
                paper_text=_NEW,
                ours_text=f"slope {slope:.2f}, {spread_db:.1f} dB rms after an offset of {offset_db:.1f} dB",
                definition="recorded S against the budget of a patch, flat beam; antenna and cables are not known",
                why="It does not rise with the elevation as computed.",
                new=True,
            )
        )
    return items


def _cn0_picture(computed: _Computed) -> Picture:
    figure = new_figure()
    axis = figure.axes[0]
    elevation_deg = np.degrees(computed.elevation_rad)
    data: dict[str, FloatArray] = {"elevation_deg": elevation_deg}
    for band in (L1, L5):
        recorded, expected, used = _levels_dbhz(computed, band)
        offset_db = float(np.mean((recorded - expected)[used]))
        (points,) = axis.plot(elevation_deg, recorded, "o", label=f"{BANDS[band]}, recorded")
        order = np.argsort(elevation_deg)
        axis.plot(
            elevation_deg[order],
            (expected + offset_db)[order],
            color=points.get_color(),
            label=f"{BANDS[band]}, budget",
        )
        data |= {f"recorded_{BANDS[band]}_dbhz": recorded, f"budget_{BANDS[band]}_dbhz": expected + offset_db}
    axis.set_xlabel("elevation [deg]")
    axis.set_ylabel("C/N0 [dB-Hz]")
    axis.legend()
    return Picture(
        name="recorded-cn0",
        title="C/N0 by elevation, recorded and computed",
        caption="Recorded at a still receiver; the budget is shifted by one offset a band, for antenna and cables.",
        figure=figure,
        data=data,
    )
