"""``python -m selfmodel``: the command line."""

from selfmodel.cli import main

main()
