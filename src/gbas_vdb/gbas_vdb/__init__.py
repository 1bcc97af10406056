"""The VHF data broadcast: GBAS messages to bits and back. No ROS, no clock, no files.

From the air upwards: :mod:`radio` (symbols, scrambling, training sequence), :mod:`fec`, :mod:`block` (header, CRC),
:mod:`tables` (every field, as data) interpreted by :mod:`fields` into the records of :mod:`messages`. :mod:`schedule`
makes the bursts of a frame, :mod:`receive` takes a burst apart, :mod:`describe` writes and reads JSON,
:mod:`ephemeris_crc` ties corrections to an ephemeris. Whatever bits come in, only :mod:`errors` come out.
"""
