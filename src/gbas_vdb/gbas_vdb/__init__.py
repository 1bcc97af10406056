"""The VHF data broadcast: GBAS messages to bits and back. No ROS, no clock, no files.

================  =====================================================================================================
``coding``        CRCs, forward error correction, scrambling and symbols
``messages``      fields as data, interpreted into records; blocks, FAS data blocks, ephemeris CRC; all of it as JSON
``transmission``  the bursts of a frame, and what a receiver makes of a burst
``errors``        whatever bits come in, only these come out
================  =====================================================================================================
"""
