"""Entry point of the command line: ``selfmodel``, and ``python -m selfmodel``."""

import os
import signal


def main() -> None:
    """Runs the command line.

    Until the command line is imported and handles stop signals, Ctrl-C ends the process without a
    traceback, as SIGTERM does. Worker processes import no module of the working folder, such as a
    ``multiprocessing.py`` there, in the place of Python's own.
    """
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from selfmodel.cli import main as run  # noqa: PLC0415  # Ctrl-C has to be set before

    run()


if __name__ == "__main__":
    main()
