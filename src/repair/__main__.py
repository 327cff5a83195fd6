"""``python -m repair``: the same as the command ``repair``."""

from repair.cli.command import entry

if __name__ == "__main__":
    entry()
