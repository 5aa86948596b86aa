"""Text for people: harmless characters, and nouns that agree with their number."""


def plain(text: str) -> str:
    r"""Returns text as one line: every character that is not printable is escaped as by ``repr``.

    Names in files may contain any character: a line feed would begin a forged line, and control
    characters command a terminal.

    Examples:
        >>> plain("quadruped\nok: other.mcap")
        'quadruped\\nok: other.mcap'
    """
    if text.isprintable():
        return text
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode() for char in text
    )


def figure_text(text: str) -> str:
    """Returns ``plain`` text for matplotlib, which reads a formula between two ``$``."""
    return plain(text).replace("$", r"\$")


def counted(number: float, noun: str) -> str:
    """Returns a number and its noun in the singular or plural.

    Examples:
        >>> counted(1, "log"), counted(2, "batch")
        ('1 log', '2 batches')
    """
    ending = "" if number == 1 else "es" if noun.endswith("ch") else "s"
    return f"{number} {noun}{ending}"
