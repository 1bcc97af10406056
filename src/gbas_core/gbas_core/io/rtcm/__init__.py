"""Recorded RTCM 3 streams as arrays on the satellite axis.

Observations come from the multiple signal messages (MSM4 to MSM7) of GPS and Galileo, ephemerides from messages 1019,
1045 and 1046. The parser is sidereon. Whatever cannot be understood is refused with a :class:`RtcmError` that names the
file; whatever is left out of the result is said in `notes`.

Source: RTCM 10403.3, messages 1005, 1006, 1019, 1045, 1046, 1074 to 1077 and 1094 to 1097.
"""

from gbas_core.io.rtcm.ephemerides import read_rtcm_navigation
from gbas_core.io.rtcm.observations import read_rtcm
from gbas_core.io.rtcm.stream import RtcmError, is_rtcm

__all__ = ["RtcmError", "is_rtcm", "read_rtcm", "read_rtcm_navigation"]
