"""Files of receivers: RINEX 2 to 4, CRINEX, RTCM 3, and recordings made of several of them."""
