"""``python -m selfmodel``: the same command line as ``selfmodel``."""

from selfmodel.cli import main

main()
