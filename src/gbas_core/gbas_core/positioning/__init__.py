"""From ranges to a position, and where it is on the final approach."""
