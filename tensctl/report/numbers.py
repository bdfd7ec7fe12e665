"""Numbers as people read them: significant digits, powers of ten, grouped thousands, a real minus sign."""

import math

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
THIN_SPACE = "\u202f"


def power_of_ten(exponent: int) -> str:
    """``10⁻³`` for -3."""
    return "10" + str(exponent).translate(_RAISED)


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits; tiny and huge ones as a power of ten, None as a dash.

    Plain notation from 1e-3 up to 1e6, because outside of it a reader counts zeros.
    """
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "\u2212∞"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    exponent = math.floor(math.log10(abs(rounded)))
    if -3 <= exponent < 6:
        text = f"{rounded:.{max(0, digits - 1 - exponent)}f}"
        return grouped(text).replace("-", "\u2212")
    mantissa = f"{rounded / 10.0**exponent:.{min(digits, 2) - 1}f}"
    return f"{mantissa}\u2009×\u2009{power_of_ten(exponent)}".replace("-", "\u2212")


def plain(value: float) -> str:
    """A number that somebody chose, such as a bound: as few digits as it takes, at most six."""
    if not math.isfinite(value) or value == 0:
        return number(value)
    exponent = math.floor(math.log10(abs(value)) + 1e-12)
    if -3 <= exponent < 6:
        return grouped(f"{value:.6g}").replace("-", "\u2212")
    mantissa = f"{value / 10.0**exponent:.6g}"
    factor = "" if mantissa == "1" else f"{mantissa}\u2009×\u2009"
    return f"{factor}{power_of_ten(exponent)}".replace("-", "\u2212")


def fixed(value: float, places: int = 5) -> str:
    """A number with so many places, so that those below each other compare; rounding shows no minus zero."""
    return f"{round(value, places) + 0.0:.{places}f}".replace("-", "\u2212")


def grouped(text: str) -> str:
    """Thousands of a plain decimal number set apart by thin spaces, from five digits on."""
    sign, digits = ("-", text[1:]) if text.startswith("-") else ("", text)
    whole, dot, rest = digits.partition(".")
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", THIN_SPACE)
    return sign + whole + dot + rest


def count(value: int | None) -> str:
    """A whole number, grouped; None as a dash."""
    return "–" if value is None else grouped(str(int(value))).replace("-", "\u2212")


def seconds(value: float) -> str:
    """A duration with its unit, from microseconds to minutes."""
    if value >= 120:
        return f"{int(value // 60)} min {int(value % 60)} s"
    for scale, unit in ((1.0, "s"), (1e3, "ms")):
        if value * scale >= 1:
            return f"{number(value * scale, 3)} {unit}"
    return f"{number(value * 1e6, 3)} µs"


def sentence(text: str) -> str:
    """A text with a capital at its start and a full stop at its end."""
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) or not text else ".")


def plural(how_many: int, noun: str) -> str:
    """``1 rod``, ``2 rods``."""
    return f"{count(how_many)} {noun}" + ("" if how_many == 1 else "s")
