"""Flight path guidance: the smallest change of the flight that keeps the satellites, or brings them back soonest.

``params`` are the aircraft's limits and what is asked of a change; ``candidates`` a few ways the aircraft can fly;
``guidance`` chooses among them by the prediction's own code, with a margin for errors of attitude.

Source: Sabatini, Moore, Hill, WASET 7 (2013), correction: alternate flight path computation, of which it gives no
algorithm; this one is ours.
"""
