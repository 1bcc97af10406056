"""Position, deviations from the final approach path, alert limits."""
