"""Message types and their fields, message blocks, FAS data blocks, ephemeris CRC; and all of it in words."""
