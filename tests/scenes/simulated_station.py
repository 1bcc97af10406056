"""A station at Braunschweig with one approach, as a file has it, for flights of the simulated world."""

from __future__ import annotations

GROUND = {
    "station": {
        "id": "EDVE", "latitude_deg": 52.3209, "longitude_deg": 10.55, "height_m": 130.0, "gcid": 1, "systems": "GE",
    },
    "receivers": {
        "rr1_ecef_m": [3840619.039, 715604.228, 5024909.863],
        "rr2_ecef_m": [3840835.113, 714861.969, 5024848.587],
        "rr3_ecef_m": [3841202.939, 715429.959, 5024488.675],
    },
    "accuracy": {"designator": "C"},
    "atmosphere": {
        "sigma_vert_iono_gradient": 4e-6, "refractivity": 379.0, "refractivity_uncertainty": 20.0,
        "scale_height_m": 7900.0,
    },
    "ephemeris": {"k_md_e_c": 5.0},
    "vdb": {"slots": "AB"},
    "approaches": {
        "rwy26": {
            "ltp_latitude_deg": 52.3209, "ltp_longitude_deg": 10.567, "ltp_height_m": 133.0, "course_deg": 264.73,
            "fpap_distance_m": 2300.0, "tch_m": 15.0, "gpa_deg": 3.0, "fasval_m": 10.0, "faslal_m": 40.0,
            "airport_id": "EDVE", "runway": "26", "rpi": "G26A", "apd": 1,
        }
    },
}  # fmt: skip
