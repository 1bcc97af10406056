"""Error models of the standard, and the multipliers of its protection levels."""
