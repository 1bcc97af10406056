"""The small world with everything the processing modes need: a second band, type 11 messages, ionosphere.

Corrections of the second band are put where the receiver keeps what it received; how they travel is tested elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from airborne_world import World, burst_of, station_data
from gbas_airborne import receiver
from gbas_airborne.reception.columns import PRC, SIGMA
from gbas_core.gnss.gpstime import modified_z_count_s
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID
from gbas_core.signals import L1, L5
from gbas_vdb.messages.types import AdditionalBlock3, Correction30, Type2, Type11
from gbas_vdb.transmission.burst import Burst

IONO_RATIO_L5 = (154.0 / 115.0) ** 2
"""(f_L1 / f_L5)^2 = 1.7933."""
SIGMA_30_M, SIGMA_D_M, SIGMA_L5_M = 0.36, 0.14, 0.1
P_D = 1.5e-4


ADB3 = AdditionalBlock3(k_md_e_d_gps=5.1, sigma_vert_iono_gradient_d=3e-6, y_eig_m=1.0, m_eig=2e-4)


def service_d_data(*, adb3: AdditionalBlock3 | None = ADB3, **changes: object) -> Type2:
    """Station data of a station that serves GAST-D: GCID 2, additional data blocks 3 and 4."""
    return replace(station_data(**{"gcid": 2, "slot_group": 0b11001111} | changes), adb3=adb3)


@dataclass
class ModesWorld(World):
    """Adds L5 and E5a, 30 s corrections, and a difference of ionosphere between aircraft and station.

    Attributes
    ----------
    iono_m : callable
        Delay on L1 at the aircraft less that at the station, at a time, on the satellite axis [m].
    l5_bias_m : (N_SATS,) array
        What the satellite's error on L5 is more than on L1; it is corrected [m].
    sends_type11, sends_l5 : callable
        Whether these corrections are sent at a time.
    """

    iono_m: Callable[[float], np.ndarray] = field(default=lambda t: np.zeros(N_SATS))
    l5_code_error_m: Callable[[float], np.ndarray] = field(default=lambda t: np.zeros(N_SATS))
    sends_type11: Callable[[float], bool] = field(default=lambda t: True)
    sends_l5: Callable[[float], bool] = field(default=lambda t: True)
    prc_30_extra_m: Callable[[float], np.ndarray] = field(default=lambda t: np.zeros(N_SATS))

    def __post_init__(self) -> None:
        self.station_message = self.station_message or service_d_data()
        super().__post_init__()
        self.l5_bias_m = np.round(np.random.default_rng(11).uniform(-3.0, 3.0, N_SATS), 2)

    def observations(self, t: float) -> ObservationEpoch:
        seen = super().observations(t)
        code, carrier, lli = seen.code_m.copy(), seen.carrier_m.copy(), seen.lli.copy()
        iono_m, noise_m = self.iono_m(t), self.code_error_m(t)
        code[L5] = code[L1] - noise_m + self.l5_bias_m + IONO_RATIO_L5 * iono_m + self.l5_code_error_m(t)
        carrier[L5] = carrier[L1] + self.l5_bias_m - IONO_RATIO_L5 * iono_m + 77.0
        code[L1] += iono_m
        carrier[L1] -= iono_m
        lli[L5] = lli[L1]
        cn0 = np.where(np.isfinite(code), 45.0, np.nan)
        return replace(seen, code_m=code, carrier_m=carrier, lli=lli, cn0_dbhz=cn0)

    def type11(self, t: float) -> list[Type11]:
        """The 30 s corrections of the satellites of the type 1 messages, in their order."""
        extra_m = dict(zip(RANGING_SOURCE_ID.tolist(), self.prc_30_extra_m(t).tolist(), strict=True))
        return [
            Type11(
                modified_z_count_s=modified_z_count_s(self.time(t)[1]),
                additional_message_flag=message.additional_message_flag,
                ephemeris_decorrelation_d=P_D if message.measurements else float("nan"),
                measurements=tuple(
                    Correction30(
                        ranging_source_id=each.ranging_source_id,
                        prc_30_m=each.prc_m + extra_m[each.ranging_source_id],
                        rrc_30_mps=each.rrc_mps,
                        sigma_pr_gnd_d_m=SIGMA_D_M,
                        sigma_pr_gnd_30_m=SIGMA_30_M,
                    )
                    for each in message.measurements
                ),
            )
            for message in self.type1(t)
        ]

    def bursts(self, t: float) -> tuple[Burst, ...]:
        usual = super().bursts(t)
        if not self.sends_type11(t):
            return usual
        week, tow_s = self.time(t)
        added = tuple(
            burst_of([message], week, tow_s, slot=2 + place, in_frame=len(usual) + 2)
            for place, message in enumerate(self.type11(t))
        )
        return tuple(replace(burst, bursts_in_frame=len(usual) + len(added)) for burst in (*usual, *added))


def receive_l5(monkeypatch: pytest.MonkeyPatch, world: ModesWorld) -> None:
    """Let the receiver have corrections of L5 with every set of L1, of both time constants."""
    plain = receiver.receive

    def with_l5(state, epoch, params):
        state, received = plain(state, epoch, params)
        sets, t = dict(received.corrections), epoch.tow_s - world.start_s
        for of_l1, of_l5 in (("l1_100", "l5_100"), ("l1_30", "l5_30")):
            if of_l1 in sets and world.sends_l5(t):
                columns = sets[of_l1].columns.copy()
                columns[PRC] -= world.l5_bias_m
                columns[SIGMA] = np.where(np.isfinite(columns[SIGMA]), SIGMA_L5_M, np.nan)
                sets[of_l5] = replace(sets[of_l1], columns=columns)
        return state, replace(received, corrections=sets)

    monkeypatch.setattr(receiver, "receive", with_l5)
