"""The command ``repair``."""

from repair.cli.command import entry, main

__all__ = ["entry", "main"]
