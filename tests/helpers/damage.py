"""Damaged bytes, of any file, as a hypothesis strategy."""

from hypothesis import strategies as st

KINDS = ("flips", "cut", "garbage", "zeros", "lost", "twice", "swapped")


@st.composite
def damaged(draw: st.DrawFn, data: bytes) -> bytes:
    """Draws what disks, cables and crashes make of a file."""
    place = st.integers(0, len(data) - 1)
    kind = draw(st.sampled_from(KINDS))
    if kind == "flips":
        spoilt = bytearray(data)
        for _ in range(draw(st.integers(1, 3))):
            spoilt[draw(place)] ^= 1 << draw(st.integers(0, 7))
        return bytes(spoilt)
    first, second = sorted((draw(place), draw(place)))
    end = min(first + draw(st.integers(1, 600)), second + 1)
    others = {
        "cut": b"",
        "garbage": draw(st.binary(min_size=1, max_size=99)) + data[end:],
        "zeros": bytes(end - first) + data[end:],
        "lost": data[end:],
        "twice": data[first:end] + data[first:],
        "swapped": data[second:] + data[end:second] + data[first:end],
    }
    return data[:first] + others[kind]
