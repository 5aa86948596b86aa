"""Texts of a recording or a model in TOML, where they may contain any character."""


def quoted(text: str) -> str:
    """Returns the TOML string of a text."""
    return f'"{escaped(text)}"'


def escaped(text: str) -> str:
    """Returns a text as in a TOML string or comment."""
    return "".join(
        char if char.isprintable() and char not in '"\\' else f"\\U{ord(char):08X}" for char in text
    )


def key(name: str) -> str:
    """Returns the TOML key of a name."""
    return (
        name
        if name.replace("_", "").replace("-", "").isalnum() and name.isascii()
        else quoted(name)
    )
