"""Bits: CRCs, forward error correction, scrambling and D8PSK symbols."""
