"""Text for terminals: harmless characters, and nouns that agree with their number."""


def plain(text: str) -> str:
    """Returns text with every control character escaped: names in a log may contain any."""
    return "".join(
        char if char.isprintable() or char == "\n" else char.encode("unicode_escape").decode()
        for char in text
    )


def counted(number: int, noun: str) -> str:
    """Returns a number and its noun, such as ``1 log`` or ``2 logs``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
