"""``python -m torchsynth``: the command line."""

from torchsynth.cli import entry_point

if __name__ == "__main__":
    entry_point()
