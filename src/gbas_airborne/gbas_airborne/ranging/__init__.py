"""Own ranges, smoothed and corrected, and why the others are not used."""
