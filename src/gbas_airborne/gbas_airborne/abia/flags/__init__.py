"""Integrity flags: caution before navigation is lost, warning when it is, each cause by itself.

``causes`` are what is looked at; ``epoch`` what is known at one time and what comes out; ``criteria`` the rules of each
cause, ``ahead`` those of what the prediction leaves; ``hold`` keeps flags from flickering and never delays a warning;
``generator`` puts them together, one epoch a step.

Source: Sabatini, Moore, Hill, WASET 7 (2013), section IV.H, with its misprints corrected.
"""
