"""The ``gbas`` command: one module a group of subcommands."""
