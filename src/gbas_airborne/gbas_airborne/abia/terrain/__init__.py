"""The ground as an obstacle: an elevation tile, and the horizon an aircraft sees over it."""
