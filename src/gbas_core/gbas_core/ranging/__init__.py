"""From raw code and carrier to smoothed ranges: slips, Hatch filter, combinations, divergence filters."""
