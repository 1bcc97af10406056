"""What the station has told, from VDB bursts."""
