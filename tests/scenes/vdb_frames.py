"""What frames of the VDB are made of, and what is in their bursts, shared by the tests of schedules."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gbas_vdb.messages import types as m
from gbas_vdb.transmission.burst import Burst
from gbas_vdb.transmission.frame import SourceCorrection
from gbas_vdb.transmission.receive import DecodedBurst, decode_burst

NAN = math.nan
STATION = m.Type2(
    n_reference_receivers=4,
    ground_accuracy_designator="C",
    gcid=1,
    magnetic_variation_rad=0.0,
    sigma_vert_iono_gradient=4e-6,
    refractivity_index=379,
    scale_height_m=7900,
    refractivity_uncertainty=20,
    latitude_rad=0.91,
    longitude_rad=0.18,
    ellipsoid_height_m=87.5,
    adb1=m.AdditionalBlock1(k_md_e_pos_gps=5.0, k_md_e_c_gps=5.0),
)


def approach(number: int) -> m.FasDataSet:
    fas = m.FasBlock(
        airport_id="EDVE",
        runway_number=26,
        approach_performance_designator=1,
        reference_path_data_selector=number,
        reference_path_identifier=f"G26{number}",
        ltp_latitude_rad=0.912,
        ltp_longitude_rad=0.184,
        ltp_height_m=130.0,
        delta_fpap_latitude_rad=-1e-5,
        delta_fpap_longitude_rad=-4e-4,
        tch_m=15.0,
        gpa_rad=math.radians(3.0),
        course_width_m=105.0,
    )
    return m.FasDataSet(fas=fas, fasval_m=10.0, faslal_m=40.0)


def source(number: int, iod: int = 7, *, gast_d: bool = False) -> SourceCorrection:
    correction_30 = m.Correction30(
        ranging_source_id=number, prc_30_m=0.02 * number, rrc_30_mps=0.0, sigma_pr_gnd_d_m=0.2, sigma_pr_gnd_30_m=0.3
    )
    correction_100 = m.Correction100(
        ranging_source_id=number,
        iod=iod,
        prc_m=0.01 * number,
        rrc_mps=0.0,
        sigma_pr_gnd_m=0.2,
        b_values_m=(0.0, 0.0, NAN, NAN),
    )
    return SourceCorrection(
        corrections={1: correction_100, 11: correction_30} if gast_d else {1: correction_100},
        ephemeris_crc=1000 * iod + number,
        decorrelation={1: number * 5e-6, 11: number * 1e-5},
    )


def messages(bursts: Sequence[Burst], kind: type) -> list:  # type: ignore[type-arg]
    decoded: list[DecodedBurst] = [decode_burst(burst) for burst in bursts]
    assert all(burst.errors == () for burst in decoded)
    return [block.message for burst in decoded for block in burst.blocks if isinstance(block.message, kind)]
