"""``python -m sightline``: the program, with the arguments that a shell gives it."""

import signal
import sys

from . import _native


def main() -> None:
    """Runs the program and ends the process with its exit code."""
    arguments = sys.argv[1:]
    # The program listens for Ctrl-C itself: it finishes what it does, writes it and exits with 130.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.main(["sightline", *arguments]))


if __name__ == "__main__":
    main()
