"""RINEX observation and navigation files as arrays on the satellite axis.

With :mod:`gbas_core.io.rtcm` the only part of the suite that reads GNSS files and knows the parser (sidereon). It reads
RINEX 2, 3 and 4, plain or gzip, observations also in compact form (CRINEX). Whatever cannot be understood is refused
with a :class:`RinexError` that names the file; whatever is left out of the result is said in `notes`.

Source: RINEX 2.11, 3.05 and 4.02 (IGS/RTCM).
"""

from gbas_core.io.rinex.navigation import NavigationFile, read_navigation
from gbas_core.io.rinex.observations import ObservationFile, read_observations
from gbas_core.io.rinex.text import RinexError
from gbas_core.io.tracking_codes import DEFAULT_SIGNALS, SignalChoice, SignalTable

__all__ = [
    "RinexError",
    "read_observations",
    "ObservationFile",
    "SignalChoice",
    "SignalTable",
    "DEFAULT_SIGNALS",
    "read_navigation",
    "NavigationFile",
]
