"""Protection levels."""
