"""Words and numbers of text formats, read from bytes by compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel


@kernel
def decimal(text: NDArray[np.uint8], at: int, end: int) -> tuple[float, int, bool]:
    """A decimal number, where it ends, and whether it is one.  Correct to the last place or two."""
    negative = text[at] == 45
    if text[at] == 45 or text[at] == 43:
        at += 1
    mantissa = 0
    exponent = 0
    digits = 0
    point = False
    while at < end:
        c = text[at]
        if 48 <= c <= 57:
            digits += 1
            if mantissa < 900_000_000_000_000_000:
                mantissa = mantissa * 10 + (c - 48)
                exponent -= 1 if point else 0
            else:
                exponent += 0 if point else 1
        elif c == 46 and not point:
            point = True
        else:
            break
        at += 1
    good = digits > 0
    if good and at < end and (text[at] == 101 or text[at] == 69):
        at += 1
        down = at < end and text[at] == 45
        if at < end and (text[at] == 45 or text[at] == 43):
            at += 1
        power = 0
        good = at < end and 48 <= text[at] <= 57
        while at < end and 48 <= text[at] <= 57:
            power = min(power * 10 + (text[at] - 48), 100_000)
            at += 1
        exponent += -power if down else power
    value = float(mantissa)
    if mantissa != 0:
        if exponent < -400:
            value = 0.0
        elif exponent > 330:
            value = np.inf
        elif exponent < 0:
            # in two steps, as 1e-300 and less has no reciprocal
            value = value / 10.0 ** min(-exponent, 290) / 10.0 ** max(-exponent - 290, 0)
        else:
            value = value * 10.0 ** min(exponent, 290) * 10.0 ** max(exponent - 290, 0)
    return (-value if negative else value), at, good


@kernel
def blank(text: NDArray[np.uint8], at: int, end: int) -> int:
    """Past blanks, and past line ends that a backslash takes back."""
    while at < end:
        c = text[at]
        if c == 32 or c == 9 or c == 11 or c == 12:
            at += 1
        elif c == 92:
            after = at + 1
            while after < end and (text[after] == 32 or text[after] == 9):
                after += 1
            if after < end and text[after] != 10 and text[after] != 13:
                break
            crlf = after + 1 < end and text[after] == 13 and text[after + 1] == 10
            at = after + 2 if crlf else after + 1
        else:
            break
    return min(at, end)


@kernel
def ends(text: NDArray[np.uint8], at: int, end: int) -> bool:
    """Whether a word ends here."""
    if at >= end:
        return True
    c = text[at]
    return bool(c == 32 or 9 <= c <= 13 or c == 35 or c == 92)


@kernel
def finite_word(text: NDArray[np.uint8], at: int, end: int) -> bool:
    """Whether a word is anything but some spelling of nan or infinity."""
    if at < end and (text[at] == 45 or text[at] == 43):
        at += 1
    if at + 2 >= end:
        return True
    a, b, c = text[at] | 32, text[at + 1] | 32, text[at + 2] | 32
    nan = a == 110 and b == 97 and c == 110
    infinite = a == 105 and b == 110 and c == 102
    return not (nan or infinite)


@kernel
def next_line(text: NDArray[np.uint8], at: int, end: int) -> int:
    """The beginning of the next line, whatever ends this one."""
    while at < end and text[at] != 10 and text[at] != 13:
        at += 1
    if at + 1 < end and text[at] == 13 and text[at + 1] == 10:
        at += 1
    return at + 1
