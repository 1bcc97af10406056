"""What a receiver's loops have to follow on a flight: motion along the lines of sight, and the Doppler of signals."""
