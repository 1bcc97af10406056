"""Where reference receivers should stand so that every ionosphere gradient is detected with the noisiest carriers.

``worst_gradient`` evaluates a set of baselines exactly, ``problem`` says what is to be placed and under which bounds,
``search`` finds the best places and proves how good they can be at most, with the help of ``contraction``; ``chain`` is
the closed form of the simplest arrangement. Positions are along the runway from the first receiver [m], positive in the
direction of the bearing.
"""
