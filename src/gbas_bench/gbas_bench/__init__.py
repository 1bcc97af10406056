"""How fast the suite is on this machine: each figure against a bound or a peer."""
