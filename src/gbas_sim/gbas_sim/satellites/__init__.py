"""Where satellites are, what they broadcast, and the lines of sight to them."""
