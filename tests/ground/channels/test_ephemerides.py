"""Which ephemeris the station corrects with: the CRC it broadcasts is always that one's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_core.gnss.ephemeris import FIELDS, Ephemeris
from gbas_core.gnss.gpstime import add_seconds
from gbas_ground.channels.ephemerides import choose, initial_ephemerides, receive
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs
from ground_runs import params
from synthetic_ranges import TOW_S, WEEK, truth

STATION = params(2, ephemeris__settle_s=0.0)
WORLD = truth(2).ephemeris
# Steps that a navigation message can carry and that move no satellite by more than the 250 m a change may move it.
SMALL = {
    "crs_m": 32.0, "crc_m": 32.0, "cuc_rad": 2.0**-20, "cus_rad": 2.0**-20, "cic_rad": 2.0**-20, "cis_rad": 2.0**-20,
    "e": 2.0**-24, "sqrt_a": 2.0**-14, "m0_rad": 2.0**-20, "omega0_rad": 2.0**-20, "i0_rad": 2.0**-20,
    "omega_rad": 2.0**-20, "omega_dot_radps": 2.0**-40, "idot_radps": 2.0**-40, "delta_n_radps": 2.0**-40,
    "af0_s": 2.0**-28, "af1_sps": 2.0**-40, "af2_sps2": 2.0**-55, "group_delay_s": 2.0**-29,
    "group_delay_e5b_s": 2.0**-29, "toc_tow_s": 960.0,
}  # fmt: skip


def received(ephemeris: Ephemeris, seconds: float) -> Ephemeris:
    week, tow_s = add_seconds(WEEK, TOW_S, seconds)
    return replace(ephemeris, gps_week=week, tow_s=tow_s)


@pytest.mark.parametrize("field", FIELDS)
def test_the_crc_is_that_of_the_ephemeris_in_use(field: str) -> None:
    """A record that differs in one field, whatever field, under the same issue of data is a fault, and must be told."""
    state, _ = receive(initial_ephemerides(), received(WORLD, 0.0), WEEK, TOW_S, STATION)
    state, _, _ = choose(state, WEEK, TOW_S, STATION)
    np.testing.assert_array_equal(state.crc, ephemeris_crcs(state.current))
    other = replace(WORLD, **{field: getattr(WORLD, field) + SMALL.get(field, 1.0)})
    state, _ = receive(state, received(other, 1.0), *add_seconds(WEEK, TOW_S, 1.0), STATION)
    state, changed, _ = choose(state, *add_seconds(WEEK, TOW_S, 2.0), STATION)
    np.testing.assert_array_equal(state.crc, ephemeris_crcs(state.current))
    if field in SMALL:
        present = np.isfinite(getattr(WORLD, field))
        assert present.any()
        assert changed[present].all()
