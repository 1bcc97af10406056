"""Published results recomputed, and campaigns that go further."""
