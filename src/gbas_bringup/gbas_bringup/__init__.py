"""Running the suite: the ``gbas`` command, launcher, recorder, player and bags."""

__version__ = "0.1.0"
