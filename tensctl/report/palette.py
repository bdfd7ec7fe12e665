"""Every colour of the report, once, on light and on dark paper; print uses the light ones."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Ink:
    """One colour under its CSS variable's name, on light and on dark paper."""

    name: str
    light: str
    dark: str


PAPER = Ink("paper", "#fcfcfd", "#12161c")
CARD = Ink("card", "#fffffe", "#191f27")
TEXT = Ink("text", "#18202b", "#e7eaef")
MUTED = Ink("muted", "#566172", "#9aa5b4")
RULE = Ink("rule", "#d9dee5", "#303945")
FAINT = Ink("faint", "#a9b3c1", "#5a6677")
BAND = Ink("band", "#e6ebf2", "#27303b")
BLUE = Ink("blue", "#0a62a9", "#63b3f0")
ORANGE = Ink("orange", "#c2500a", "#f39a4d")
GREEN = Ink("green", "#0d7d5c", "#3fc79b")
PURPLE = Ink("purple", "#96458e", "#dd94d6")
GOOD = Ink("good", "#0c7552", "#41c795")
BAD = Ink("bad", "#bb2233", "#ff7b85")
DOUBT = Ink("doubt", "#8a5c00", "#e3b04b")
ROD = Ink("rod", "#39424f", "#aab4c2")
ROD_LIGHT = Ink("rod-light", "#8d98a8", "#eef1f5")
SLACK = Ink("slack", "#a0a8b3", "#6d7886")
GHOST = Ink("ghost", "#d3912b", "#c99a4a")

# Lines that must be told apart also differ in dash (see plots.DASHES): the hues do for the common colour
# blindnesses, the dashes for a grey print.
SERIES = (BLUE, ORANGE, GREEN, PURPLE)

# Tension, low to high: lightness falls steadily on light paper and rises on dark paper, so that the order
# survives colour blindness and grey print, and the highest tension always has the strongest contrast.
_RAMP_LIGHT = (
    *("#7fcfc4", "#58bac3", "#40a2c0", "#3d88b8", "#436eab"),
    *("#4a5398", "#4d3880", "#4a2160", "#3f0f3c"),
)
_RAMP_DARK = (
    *("#5d57a4", "#4a71b8", "#358bbe", "#3ea1b8", "#53b5b2"),
    *("#71c8aa", "#94d999", "#c7e489", "#f8ea97"),
)
RAMP = tuple(Ink(f"ramp-{k}", a, b) for k, (a, b) in enumerate(zip(_RAMP_LIGHT, _RAMP_DARK, strict=True)))

INKS = (
    *(PAPER, CARD, TEXT, MUTED, RULE, FAINT, BAND, BLUE, ORANGE, GREEN, PURPLE),
    *(GOOD, BAD, DOUBT, ROD, ROD_LIGHT, SLACK, GHOST),
    *RAMP,
)


def declarations(*, dark: bool) -> str:
    """CSS variables of every colour, for one kind of paper."""
    return "".join(f"--{ink.name}:{ink.dark if dark else ink.light};" for ink in INKS)
