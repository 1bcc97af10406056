"""What the flight ahead will do to navigation: the attitudes that may come, and the satellites they cost.

``plan`` has what is flown and what is planned; ``hypotheses`` the ways in which the plan may be flown, by predictor;
``identification`` what the bank tells of which it is; ``look_ahead`` what comes of each of them; ``predictors`` the
whole, by name, and what is done when attitude, plan or satellites are not known. Lines of sight are those of now in
local axes: in the seconds looked ahead the attitude turns by far more than the satellites.

Source: Sabatini, Moore, Hill, WASET 7 (2013), section IV.H and the manoeuvre identification of its future work.
"""
