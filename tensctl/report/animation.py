"""What the page's viewer is fed: motion and mode shapes, quantised, as JSON that is safe inside HTML."""

import json
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tensctl.report.case import Case
from tensctl.report.grounded import tension_scale
from tensctl.report.pack import base64_of, pack, pack_shapes
from tensctl.report.palette import INKS

MOST_SHAPES = 100  # mode shapes carried by the page, lowest first: 40 kB at (8,4)
COMFORTABLE = (3.0, 40.0)  # s; a run that lasts this long starts playing at its own speed
_WATCHING = 12.0  # s; what another one should take


@dataclass(frozen=True)
class Motion:
    """Frames to show, all finite, and their source: "run", "path", "equilibrium" or "structure"."""

    source: str
    times: np.ndarray
    nodes: np.ndarray
    tensions: np.ndarray

    @property
    def duration(self) -> float:
        """Length of the motion, s."""
        return float(self.times[-1] - self.times[0])


def motion_of(case: Case) -> Motion:
    """The best motion that the case has: run, else planned path, else rest, else the shape as built."""
    for source, recorded in (("run", case.run), ("path", None if case.path is None else case.path.played)):
        if recorded is None:
            continue
        finite = np.isfinite(recorded.nodes).all(axis=(1, 2)) & np.isfinite(recorded.tensions).all(axis=1)
        if finite.any():
            return Motion(source, recorded.time[finite], recorded.nodes[finite], recorded.tensions[finite])
    rest = case.equilibrium
    if rest is not None:
        return Motion("equilibrium", np.zeros(1), rest.nodes[None], rest.tensions[None])
    built = case.structure.nodes[None]
    return Motion("structure", np.zeros(1), built, np.ones((1, len(case.structure.tendons))))


def motion_data(case: Case, motion: Motion) -> dict[str, object]:
    """Everything that the viewer needs to play the motion (see assets/motion.js); its tendons are segments."""
    structure = case.structure
    packed = pack(motion.times, motion.nodes, motion.tensions[:, structure.segment_tendon])
    pinned = np.flatnonzero(structure.pinned)
    ground = float(motion.nodes[0, pinned, 2].mean()) if len(pinned) else None
    wanted = None if case.path is None else case.path.target_nodes
    return {
        "model": {
            "nodes": len(structure.nodes),
            "rods": np.asarray(structure.rods).ravel().tolist(),
            "tendons": np.asarray(structure.segments).ravel().tolist(),
            "tendonOf": np.asarray(structure.segment_tendon).tolist(),
            "pinned": pinned.tolist(),
            "ground": ground,
        },
        "rodLabels": list(structure.rod_labels),
        "tendonLabels": list(structure.segment_labels),
        "times": np.round(packed.times, 6).tolist(),
        "centre": packed.centre.tolist(),
        "reach": _reach(motion.nodes, packed.centre),
        "step": packed.step,
        "q": base64_of(packed.nodes),
        "stressed": motion.source != "structure",
        "tensionMax": packed.tension_max,
        "tensionScale": tension_scale(structure, motion.tensions),
        "t": base64_of(packed.tensions),
        "wanted": None if wanted is None else np.round(wanted, 6).ravel().tolist(),
        "pushes": [
            {"node": int(push.node), "force": list(push.force), "begin": push.begin, "end": push.end}
            for push in case.pushes
        ],
    }


def mode_data(case: Case) -> dict[str, object] | None:
    """The lowest mode shapes about the equilibrium, for the viewer of modes (see assets/modes.js)."""
    if case.linear is None or case.equilibrium is None or not case.linear.modes:
        return None
    modes = case.linear.modes[:MOST_SHAPES]
    rest = case.equilibrium.nodes
    centre = (rest.min(axis=0) + rest.max(axis=0)) / 2
    first = next((k for k, mode in enumerate(modes) if mode.kind == "flexible"), 0)
    return {
        "rest": np.round(rest, 6).ravel().tolist(),
        "centre": centre.tolist(),
        "reach": [1.1 * value for value in _reach(rest, centre)],
        "first": first,
        "titles": [_title(mode.index, mode.name or mode.kind, mode.frequency) for mode in modes],
        "shapes": base64_of(pack_shapes(np.stack([mode.shape for mode in modes]))),
    }


def _reach(nodes: np.ndarray, centre: np.ndarray) -> list[float]:
    """Largest distance (m) of a node from the vertical axis through ``centre``, and from its level."""
    across = np.linalg.norm((nodes - centre)[..., :2], axis=-1)
    return [float(np.nanmax(across)) or 1.0, float(np.nanmax(np.abs(nodes - centre)[..., 2])) or 1.0]


def _title(index: int, name: str, frequency: float) -> str:
    return f"Mode {index}: {name}, {frequency:.3g} Hz"


def palette_data() -> dict[str, dict[str, str]]:
    """Colours for the canvas, on light and on dark paper."""
    return {
        "light": {ink.name: ink.light for ink in INKS},
        "dark": {ink.name: ink.dark for ink in INKS},
    }


def speeds(duration: float) -> tuple[tuple[float, bool], ...]:
    """Playing speeds to offer for a motion of this duration (s); True marks the one to start with."""
    low, high = COMFORTABLE
    natural = 1.0 if low <= duration <= high or duration <= 0 else _round_factor(duration / _WATCHING)
    return tuple((factor * natural, factor == 1.0) for factor in (0.1, 0.25, 0.5, 1.0, 2.0, 5.0))


def _round_factor(value: float) -> float:
    decade = 10.0 ** np.floor(np.log10(value))
    return float(f"{decade * min((1, 2, 5, 10), key=lambda f: abs(f * decade - value)):.1g}")


def json_for_html(data: object) -> Markup:
    """Compact JSON that cannot end the script element that carries it."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))
