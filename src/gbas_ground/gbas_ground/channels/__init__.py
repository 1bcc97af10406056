"""What every channel (receiver and satellite) measures, against what is expected of it."""
