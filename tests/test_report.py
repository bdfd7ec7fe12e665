"""The report is one file that needs nothing else, shows what there is, and changes no number it carries."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from tensctl.report import Case, Check, Height, Limits, MpcCheck, Push, Wanted, facts, write_report
from tensctl.report.animation import json_for_html, speeds
from tensctl.report.numbers import number, seconds
from tensctl.report.pack import FEWEST_FRAMES, FRAME_BYTES, pack, unpack_nodes
from tensctl.report.page import render
from tensctl.report.strips import spread
from tensctl.report.thin import thinned, thinned_band
from tensctl.synthesis.margins import Sensitivity

# ---------------------------------------------------------------- made-up cases that look like real ones


@dataclass(frozen=True)
class FakeStructure:
    nodes: np.ndarray
    node_labels: tuple[str, ...]
    rods: np.ndarray
    rod_labels: tuple[str, ...]
    tendons: np.ndarray
    tendon_labels: tuple[str, ...]
    pinned: np.ndarray
    planar: bool = False

    @property
    def guides(self) -> np.ndarray:
        return np.zeros_like(self.nodes, bool)

    @property
    def segments(self) -> np.ndarray:
        return self.tendons

    @property
    def segment_tendon(self) -> np.ndarray:
        return np.arange(len(self.tendons))

    @property
    def segment_labels(self) -> tuple[str, ...]:
        return self.tendon_labels

    @property
    def grounded_tendons(self) -> np.ndarray:
        return self.pinned[self.tendons].all(axis=1)


@dataclass(frozen=True)
class FakeEquilibrium:
    nodes: np.ndarray
    tensions: np.ndarray
    energy: float = 12.4959153448
    residual: float = 3.1e-14
    iterations: int = 7
    stable: str = "yes"
    smallest: float = 4.203
    tolerance: float = 1e-7


@dataclass(frozen=True)
class FakeMode:
    index: int
    omega2: float
    frequency: float
    kind: str
    name: str
    cluster: int
    multiplicity: int
    shape: np.ndarray


@dataclass(frozen=True)
class FakeFlexible:
    A: np.ndarray


@dataclass(frozen=True)
class FakeLinear:
    modes: tuple[FakeMode, ...]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    flexible: FakeFlexible


@dataclass(frozen=True)
class FakeVerdict:
    index: int
    frequency: float
    kind: str
    multiplicity: int
    gain: float
    distance: float
    tendons: tuple[str, ...]
    verdict: str
    reason: str
    shares: tuple[float, ...]
    cluster: int


@dataclass(frozen=True)
class FakeControllability:
    modes: tuple[FakeVerdict, ...]
    controllable_modes: tuple[int, ...]
    uncontrollable_modes: tuple[int, ...]
    note: str = ""


HALF = Sensitivity(-np.eye(2), np.eye(2), -0.5 * np.eye(2), None)


@dataclass(frozen=True)
class FakeLqr:
    poles: np.ndarray
    residual: float
    gain_doubt: float = 1e-12
    left: tuple = ()
    sensitivity: Sensitivity = HALF


@dataclass(frozen=True)
class FakePath:
    time: np.ndarray
    nodes: np.ndarray
    tensions: np.ndarray
    target_nodes: np.ndarray
    description: str

    @property
    def played(self):
        return self


@dataclass(frozen=True)
class FakeRun:
    time: np.ndarray
    nodes: np.ndarray
    tensions: np.ndarray
    rest_lengths: np.ndarray
    inputs: np.ndarray
    input_labels: tuple[str, ...]
    status: np.ndarray
    solve_time: np.ndarray
    kkt: np.ndarray
    relaxed: np.ndarray
    sample_time: np.ndarray

    @property
    def bounded(self) -> np.ndarray:
        return np.arange(self.kkt.size) % 50 == 7

    @property
    def lengths(self) -> np.ndarray:
        return self.rest_lengths + self.tensions / STIFFNESS


@dataclass(frozen=True)
class FakeTerm:
    name: str
    included: bool
    why: str
    operations: int | None


STIFFNESS = 100.0  # N/m, of every tendon here


def shell_structure(n: int = 3) -> FakeStructure:
    """An (n,1) Class 1 shell: 2n rods, 8n tendons, its n base nodes pinned."""

    def p(k: int, i: int) -> int:
        return 4 * (i % n) + k - 1

    rows = [
        [
            (1, 1, 2, 0),
            (1, 1, 1, 0),
            (1, 0, 3, -1),
            (3, -1, 2, 0),
            (2, 0, 4, 0),
            (4, 0, 4, 1),
            (4, 1, 3, 0),
            (3, 0, 2, 0),
        ]
        for _ in range(n)
    ]
    tendons = [(p(a, i + di), p(b, i + dj)) for i, row in enumerate(rows) for a, di, b, dj in row]
    rods = [(p(a, i), p(a + 1, i)) for i in range(n) for a in (1, 3)]
    return FakeStructure(
        nodes=shell_nodes(n, 1.0),
        node_labels=tuple(f"P{k}_{i + 1}_1" for i in range(n) for k in (1, 2, 3, 4)),
        rods=np.array(rods),
        rod_labels=tuple(f"r{a}_{i + 1}_1" for i in range(n) for a in (1, 2)),
        tendons=np.array(tendons),
        tendon_labels=tuple(f"t{a}_{i + 1}_1" for i in range(n) for a in range(1, 9)),
        pinned=np.tile([True, False, False, False], n),
    )


def shell_nodes(n: int, stretch: float) -> np.ndarray:
    """Its nodes (4n, 3) when it stands ``stretch`` times as high on the same base, with the same rods."""
    rise, overlap, twist = stretch, 0.3 * stretch, 1.4
    squared = 4 * np.sin(twist / 2) ** 2 + 1.0
    upper = np.cos(twist) + np.sqrt(np.cos(twist) ** 2 + squared - 1 - rise**2)
    ring = np.sqrt(squared - rise**2) / (2 * np.sin(twist / 2))
    places = []
    for i in range(n):
        angle = 2 * np.pi * i / n
        for radius, turn, z in (
            (1.0, 0.0, 0.0),
            (upper, twist, rise),
            (ring, twist + np.pi / n, rise - overlap),
            (ring, np.pi / n, 2 * rise - overlap),
        ):
            places.append((radius * np.cos(angle + turn), radius * np.sin(angle + turn), z))
    return np.array(places)


def lengths_of(structure: FakeStructure, nodes: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(nodes[..., structure.tendons, :], axis=-2)[..., 0, :], axis=-1)


def shell_run(structure: FakeStructure, times: int, t_end: float, rng: np.random.Generator) -> FakeRun:
    """It rises by a fifth within three seconds, is pushed at five, and swings out."""
    n = len(structure.nodes) // 4
    time = np.linspace(0.0, t_end, times)
    ramp = np.clip(time / 3, 0, 1) ** 2 * (3 - 2 * np.clip(time / 3, 0, 1))
    after = np.clip(time - 5, 0, None)
    sway = 0.05 * np.sin(9 * after) * np.exp(-1.2 * after) * (after > 0)
    nodes = np.stack([shell_nodes(n, 1 + 0.2 * share) for share in ramp])
    nodes[:, :, 0] += sway[:, None] * nodes[:, :, 2]
    tendons = len(structure.tendons)
    kind = np.arange(tendons) % 8
    rest_tension = np.array([5.7, 4.4, 14.3, 12.6, 11.8, 6.4, 4.1, 9.9])[kind]
    change = np.array([0.2, 0.0, -0.5, 0.7, -0.97, 0.4, 0.3, -0.6])[kind]
    wobble = rng.normal(size=tendons) * 22 * sway[:, None] + 0.4 * np.sin(7 * ramp[:, None] * kind) * ramp[:, None]
    tensions = np.maximum(rest_tension * (1 + change * ramp[:, None]) + wobble, 0.0)
    rest_lengths = lengths_of(structure, nodes) - tensions / STIFFNESS
    acting = kind != 1
    steps = int(t_end / 0.02)
    return FakeRun(
        time=time,
        nodes=nodes,
        tensions=tensions,
        rest_lengths=rest_lengths,
        inputs=(rest_lengths[0] - rest_lengths)[:, acting],
        input_labels=tuple(label for label, acts in zip(structure.tendon_labels, acting, strict=True) if acts),
        status=np.where((time > 5) & (time < 5.3), "solved, floor relaxed", "solved"),
        solve_time=1.2e-3 * np.exp(0.25 * rng.normal(size=steps)) * (1 + 2 * (rng.random(steps) > 0.97)),
        kkt=10 ** rng.normal(-12.5, 0.6, size=steps),
        relaxed=np.where((np.arange(steps) > 250) & (np.arange(steps) < 265), 0.31 * rng.random(steps), 0.0),
        sample_time=0.02 * np.arange(steps),
    )


def fake_linear(structure: FakeStructure, rng: np.random.Generator, free: bool) -> FakeLinear:
    """Six rigid-body modes when free, then flexible ones, every third alone and the others in pairs."""
    names = [f"{motion} {axis}" for motion in ("translation", "rotation") for axis in "xyz"] if free else []
    modes = [FakeMode(k, 0.0, 0.0, "rigid-body", name, 0, 6, rng.normal(size=(12, 3))) for k, name in enumerate(names)]
    count = 24 if free else 21
    for k in range(count):
        lone, cluster = k % 3 == 0, 1 + (k // 3) * 2 + (k % 3 > 0)
        frequency = 0.33 + 0.11 * cluster**1.2
        shape = rng.normal(size=structure.nodes.shape) * ~structure.pinned[:, None]
        index = len(names) + k
        omega2 = (2 * np.pi * frequency) ** 2
        modes.append(FakeMode(index, omega2, frequency, "flexible", "", cluster, 1 if lone else 2, shape))
    omega = np.array([2 * np.pi * mode.frequency for mode in modes if mode.kind == "flexible"])
    zero = np.zeros((count, count))
    states = tuple(f"x{k}" for k in range(2 * len(modes)))
    flexible = FakeFlexible(np.block([[zero, np.diag(omega)], [-np.diag(omega), zero]]))
    return FakeLinear(tuple(modes), states, structure.tendon_labels[:21], flexible)


def fake_controllability(linear: FakeLinear, rng: np.random.Generator) -> FakeControllability:
    verdicts = []
    for mode in linear.modes:
        driven = mode.kind == "flexible"
        gain = float(rng.uniform(0.2, 2.0)) if driven else 2e-16
        kinds = tuple(rng.choice(linear.inputs, 6, replace=False)) if driven else ()
        reason = "" if driven else f"rigid-body {mode.name}: internal forces cannot change momentum"
        word = "yes" if driven else "no"
        verdicts.append(
            FakeVerdict(
                *(mode.index, mode.frequency, mode.kind, mode.multiplicity, gain, gain / 9, kinds, word, reason),
                shares=(0.1,) * len(kinds),
                cluster=mode.cluster,
            )
        )
    yes = tuple(v.index for v in verdicts if v.verdict == "yes")
    no = tuple(v.index for v in verdicts if v.verdict == "no")
    return FakeControllability(tuple(verdicts), yes, no, "One input direction only changes the prestress.")


def full_case(
    times: int = 500, n: int = 3, *, free: bool = False, title: str = "(3,1) mast stands 20 % taller"
) -> Case:
    """Every part present: 2n rods, 8n tendons."""
    rng = np.random.default_rng(7)
    structure = shell_structure(n)
    if free:
        structure = replace(structure, pinned=np.zeros(len(structure.nodes), bool))
    run = shell_run(structure, times, 10.0, rng)
    linear = fake_linear(structure, rng, free)
    omega = np.array([2 * np.pi * mode.frequency for mode in linear.modes if mode.kind == "flexible"])
    damped = -omega * rng.uniform(0.06, 0.3, len(omega)) + 1j * omega
    target = shell_nodes(n, 1.2)
    error = np.linalg.norm(run.nodes - target, axis=2).max(axis=1) + 2e-5
    terms = (
        FakeTerm("rods", True, "6 rods", 1260),
        FakeTerm("tendons", True, "24 tendons, each may go slack", 984),
        FakeTerm("gravity", False, "the scene has no [gravity]", 24),
        FakeTerm("tendon damping", False, "damping = 0", 408),
        FakeTerm("constraint multipliers", False, "no joints: every rod stays in closed form", 2310),
        FakeTerm("state estimator", False, "no [lqg]", None),
    )
    return Case(
        title=title,
        version="0.1.0",
        structure=structure,
        scene_toml='title = "mast"\n\n[structure]\nkind = "shell" # <n, m> & more\n',
        equilibrium=FakeEquilibrium(run.nodes[0], run.tensions[0]),
        linear=linear,
        controllability=fake_controllability(linear, rng),
        lqr=FakeLqr(np.concatenate([damped, damped.conj()]), 4.4e-13),
        path=FakePath(
            time=np.linspace(0, 3, 11),
            nodes=run.nodes[:: max(1, times // 11)][:11],
            tensions=run.tensions[:11],
            target_nodes=target,
            description="20 % taller by least rest-length change, every tension at least 0.1 N.",
        ),
        run=run,
        limits=Limits(0.1, 1e-3 * run.rest_lengths[0], 0.5),
        shape_error=error,
        path_error=0.01 * error,
        height=Height(1.7, 2.04),
        wanted=(Wanted("height", "m", 1.7, 2.04001, 2.04),),
        mpc_check=MpcCheck("daqp", 20, 0.02, 420, 1320, 3.2e-9, 0),
        pushes=(Push(3, (5.0, 0.0, 0.0), 5.0, 5.1),),
        explain=terms,
        checks=(
            Check("Rod length drift", 3.1e-13, 1e-12, True, "largest over the run"),
            Check("Riccati residual", 4.4e-13, 1e-9, True),
            Check("Final shape error", 2e-5, 1e-3, True, "m"),
        ),
        seconds={"equilibrium": 0.012, "dynamics": 1.31, "linear": 0.21, "controllability": 0.08, "run": 2.4},
    )


def prism_case(times: int = 60) -> Case:
    """A free prism of 3 rods and 9 tendons that turns about its axis: structure and run, nothing else."""
    angle = 2 * np.pi * np.arange(3) / 3
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    top = np.column_stack([np.cos(angle + 2.6), np.sin(angle + 2.6), np.full(3, 1.5)])
    sides = [(a, (a + 1) % 3) for a in range(3)]
    tendons = np.array([*sides, *((a + 3, b + 3) for a, b in sides), *((a, (a + 1) % 3 + 3) for a in range(3))])
    labels = tuple(f"s{k}" for k in range(9))
    nodes = np.concatenate([ring, top])
    structure = FakeStructure(
        nodes=nodes,
        node_labels=tuple("abcdef"),
        rods=np.array([(0, 3), (1, 4), (2, 5)]),
        rod_labels=("r1", "r2", "r3"),
        tendons=tendons,
        tendon_labels=labels,
        pinned=np.zeros(6, bool),
    )
    time = np.linspace(0, 6, times)
    cos, sin, zero = np.cos(time), np.sin(time), 0 * time
    turn = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1]]).transpose(2, 0, 1)
    moved = np.einsum("tij,nj->tni", turn, nodes)
    tensions = np.maximum(3 + 4 * np.sin(time[:, None] + np.arange(9)), 0)
    rest = lengths_of(structure, moved) - tensions / STIFFNESS
    none, words = np.empty(0), np.full(times, "")
    run = FakeRun(time, moved, tensions, rest, np.zeros((times, 0)), (), words, none, none, none, none)
    return Case(title="Turning prism", version="0.1.0", structure=structure, run=run)


# ---------------------------------------------------------------- what the file is


@dataclass
class Seen:
    """What a parser found in a page."""

    ids: list[str]
    tags: list[str]
    references: list[str]
    text: str


class Reader(HTMLParser):
    """Collects ids, tags, everything that could be loaded from elsewhere, and the text outside of scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.seen = Seen([], [], [], "")

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.seen.ids.append(value or "")
            if name.split(":")[-1] in {"src", "href", "srcset", "action", "poster", "data", "background"}:
                self.seen.references.append(value or "")

    def handle_data(self, data: str) -> None:
        if self.seen.tags[-1:] not in (["script"], ["style"]):
            self.seen.text += data


def read(page: str) -> Seen:
    reader = Reader()
    reader.feed(page)
    return reader.seen


@pytest.fixture(scope="module")
def full_page() -> str:
    return render(full_case())


def test_the_file_loads_nothing(full_page: str) -> None:
    seen = read(full_page)
    assert seen.references
    assert all(reference.startswith("#") for reference in seen.references)
    assert not {"link", "img", "iframe", "object", "embed", "base", "form"} & set(seen.tags)
    assert re.findall(r"url\((.)", full_page).count("#") == full_page.count("url(")
    for way_out in (
        "http://",
        "https://",
        "//cdn",
        "@import",
        "fetch(",
        "XMLHttpRequest",
        "WebSocket",
        "import(",
    ):
        assert way_out not in full_page
    assert "default-src 'none'" in full_page


def test_every_reference_inside_the_file_has_its_target_and_no_id_comes_twice(full_page: str) -> None:
    seen = read(full_page)
    assert len(seen.ids) == len(set(seen.ids))
    targets = {reference[1:] for reference in seen.references} | set(re.findall(r"url\(#([^)]+)\)", full_page))
    assert targets <= set(seen.ids)


def test_the_same_case_gives_the_same_bytes(tmp_path: Path) -> None:
    one, two = (
        write_report(prism_case(), tmp_path / "a.html"),
        write_report(prism_case(), tmp_path / "b.html"),
    )
    assert one.read_bytes() == two.read_bytes()


def test_sizes(full_page: str) -> None:
    assert len(full_page.encode()) < 700_000  # half a megabyte measured
    assert len(render(full_case(n=38)).encode()) < 2_000_000  # 304 tendons, as many as an (8,4) shell


def test_a_long_and_restless_run_stays_small() -> None:
    case = full_case(times=20_000)
    assert isinstance(case.run, FakeRun)
    restless = case.run.inputs + 1e-3 * np.random.default_rng(0).normal(size=case.run.inputs.shape)
    assert len(render(replace(case, run=replace(case.run, inputs=restless))).encode()) < 3_000_000


def test_an_earlier_report_stays_when_a_new_one_fails(tmp_path: Path) -> None:
    path = write_report(prism_case(), tmp_path / "out" / "report.html")
    before = path.read_bytes()
    with pytest.raises(AttributeError):
        write_report(replace(prism_case(), structure=None), path)  # type: ignore[arg-type]
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == ["report.html"]


def test_plotting_is_not_loaded_before_a_report_is_made() -> None:
    code = "import sys, tensctl.report; print([m for m in ('matplotlib', 'jinja2') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# ---------------------------------------------------------------- what it shows

SECTION_OF = {
    "equilibrium": "shape",
    "run": "history",
    "linear": "modes",
    "controllability": "controllability",
    "explain": "model",
}


@pytest.mark.parametrize("part", SECTION_OF)
def test_a_part_that_is_absent_is_not_shown(part: str, full_page: str) -> None:
    section = SECTION_OF[part]
    assert section in read(full_page).ids
    page = render(replace(full_case(times=40), **{part: None}))
    assert section not in read(page).ids
    assert f'href="#{section}"' not in page


def test_certificates_and_record_go_when_all_their_parts_are_absent() -> None:
    case = replace(full_case(times=40), lqr=None, mpc_check=None, run=None, checks=(), seconds={}, scene_toml=None)
    ids = read(render(case)).ids
    assert "certificates" not in ids
    assert "record" not in ids


def test_headline_numbers_are_there(full_page: str) -> None:
    text = read(full_page).text
    for fact in (
        "12.50 J",
        "3.1\u2009×\u200910⁻¹⁴",
        "21 of 21",
        "4.4\u2009×\u200910⁻¹³",
        "0.235 mm",
        "All 3 numerical",
    ):
        assert fact in text


def test_the_shape_that_was_wanted_is_told_with_its_error() -> None:
    wanted = (Wanted("twist", "rad", 0.0, -0.3999, -0.4), Wanted("P4_1_1 x", "m", 0.25, 0.5, 0.5))
    text = read(render(replace(full_case(times=60), wanted=wanted))).text
    assert "Twist, rad0.00000\u22120.40000\u22120.39990" in re.sub(r"\s*\n\s*", "", text)
    assert "P4_1_1 x, m" in text
    assert "Height" not in text


def test_a_path_that_comes_back_is_shown_where_it_is_farthest() -> None:
    case = full_case(times=61)
    assert isinstance(case.run, FakeRun)
    there_and_back = np.concatenate([case.run.nodes[:30], case.run.nodes[30::-1]])
    assert "farthest from the start" not in render(case)
    page = render(replace(case, run=replace(case.run, nodes=there_and_back)))
    moved = np.linalg.norm(there_and_back - there_and_back[0], axis=2).max(axis=1)
    assert f"At {case.run.time[moved.argmax()]:.4g} s, farthest from the start" in page


def test_a_tension_below_the_floor_is_said_even_if_the_controller_did_not_plan_it() -> None:
    case = full_case(times=60)
    assert isinstance(case.run, FakeRun)
    tensions = np.maximum(case.run.tensions, 0.2)
    tensions[30, 4] = 0.05
    run = replace(case.run, tensions=tensions, relaxed=0 * case.run.relaxed)
    text = read(render(replace(case, run=run))).text
    assert "0.0500 N in t5_1_1 at 5.08 s; below the floor at 1 of 60 recorded times" in text
    assert "planned with the whole floor at every step" in text


def test_tendons_between_pins_do_not_set_the_scale() -> None:
    case = full_case(times=60)
    assert isinstance(case.run, FakeRun)
    tensions = case.run.tensions.copy()
    tensions[:, 1::8] = 1000.0
    page = render(replace(case, run=replace(case.run, tensions=tensions)))
    assert "3 tendons between pinned nodes, up to 1000 N, in the last colour" in page
    assert "Left out, constant between pinned nodes: t2_1_1, t2_2_1, t2_3_1." in page


def test_a_failed_check_is_said_at_the_top() -> None:
    case = replace(prism_case(), checks=(Check("Rod length drift", 2e-9, 1e-12, False),))
    assert "1 of 1 numerical check failed: Rod length drift" in read(render(case)).text.replace("\n", " ")


def test_text_from_the_user_stays_text() -> None:
    nasty = "</script><script>alert(1)</script> & \"x\" 'y' $z$ {{ 1 }}"
    case = full_case(times=40, title=nasty)
    structure = case.structure
    assert isinstance(structure, FakeStructure)
    labels = (nasty, *structure.tendon_labels[1:])
    case = replace(case, structure=replace(structure, tendon_labels=labels), scene_toml=nasty)
    page, plain = read(render(case)), read(render(full_case(times=40)))
    assert page.tags.count("script") == plain.tags.count("script")
    assert "alert(1)</script>" not in render(case)
    assert page.text.count(nasty) >= 3  # the page's title, its heading and the scene


def without_limits(case: Case) -> Case:
    return replace(case, limits=None, mpc_check=None, pushes=(), height=None)


def with_a_gap(case: Case) -> Case:
    assert isinstance(case.run, FakeRun)
    nodes, tensions = case.run.nodes.copy(), case.run.tensions.copy()
    nodes[-5:], tensions[-5:] = np.nan, np.nan
    return replace(case, run=replace(case.run, nodes=nodes, tensions=tensions))


def with_an_unstable_mode(case: Case) -> Case:
    assert isinstance(case.linear, FakeLinear)
    bad = replace(case.linear.modes[0], omega2=-3.0, frequency=float("nan"), kind="unstable")
    return replace(case, linear=replace(case.linear, modes=(bad, *case.linear.modes[1:])))


def with_poles_at_rest(case: Case) -> Case:
    return replace(case, lqr=FakeLqr(np.zeros(4, complex), float("nan")))


def held_still(case: Case) -> Case:
    assert isinstance(case.run, FakeRun)
    none = np.empty(0)
    still = replace(case.run, inputs=0 * case.run.inputs, solve_time=none, kkt=none, relaxed=none, sample_time=none)
    return replace(case, run=still, mpc_check=None, shape_error=np.zeros(len(case.run.time)))


def at_one_moment(case: Case) -> Case:
    run = case.run
    assert isinstance(run, FakeRun)
    first = {name: getattr(run, name)[:1] for name in ("time", "nodes", "tensions", "rest_lengths", "inputs", "status")}
    return replace(case, run=replace(run, **first), shape_error=None)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "odd",
    [without_limits, with_a_gap, with_an_unstable_mode, with_poles_at_rest, held_still, at_one_moment],
)
def test_odd_cases_are_shown_without_a_warning(odd) -> None:
    page = render(odd(full_case(times=40)))
    assert "nan" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL).lower().split()
    assert not re.search(r'd="[^"]*nan', page)


@pytest.mark.filterwarnings("error")
def test_a_structure_alone_is_shown() -> None:
    seen = read(render(Case(title="built", version="0", structure=shell_structure())))
    assert "Structure" in seen.text
    assert "viewer" in seen.ids
    assert "Tension" not in seen.text


# ---------------------------------------------------------------- what it carries


def test_positions_survive_to_a_thirty_thousandth_of_the_size() -> None:
    rng = np.random.default_rng(3)
    nodes = rng.normal(size=(50, 12, 3)) * [1.0, 1.0, 4.0] + [100.0, 0.0, -3.0]
    packed = pack(np.linspace(0, 1, 50), nodes, rng.random((50, 24)))
    size = np.ptp(nodes.reshape(-1, 3), axis=0).max()
    assert np.abs(unpack_nodes(packed) - nodes).max() < size / 30000


def test_slack_is_exact_and_tension_survives() -> None:
    tensions = np.array([[0.0, 1e-9, 3.0], [7.0, 0.0, 0.002]])
    packed = pack(np.arange(2.0), np.zeros((2, 4, 3)), tensions)
    assert np.array_equal(packed.tensions == 0, tensions == 0)
    assert np.abs(packed.tensions * packed.tension_max / 65535 - tensions).max() <= 7.0 / 65535


def test_long_runs_are_thinned_evenly_and_keep_both_ends() -> None:
    time = np.cumsum(np.random.default_rng(1).random(9000))
    packed = pack(time, np.zeros((9000, 128, 3)), np.zeros((9000, 304)))
    frames = FRAME_BYTES // (128 * 6 + 304 * 2)
    assert FEWEST_FRAMES < frames - 5 <= len(packed.times) <= frames
    assert packed.times[0] == time[0]
    assert packed.times[-1] == time[-1]
    assert np.diff(packed.times).max() < 2 * (time[-1] - time[0]) / frames


def test_thinning_keeps_extremes_and_ends() -> None:
    time, values = np.arange(10_001.0), np.random.default_rng(2).normal(size=10_001)
    shown, drawn = thinned(time, values)
    assert len(shown) <= 1200
    assert (np.diff(shown) > 0).all()
    assert {values.min(), values.max(), values[0], values[-1]} <= set(drawn)
    assert np.array_equal(values[shown.astype(int)], drawn)
    low, high = thinned_band(time, values - 1, values + 1)[1:]
    assert (low.min(), high.max()) == (values.min() - 1, values.max() + 1)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (12.4959, "12.50"),
        (-0.40321, "\u22120.4032"),
        (123456.0, "123\u202f500"),
        (9.99996, "10.00"),
        (3.1e-14, "3.1\u2009×\u200910⁻¹⁴"),
        (float("nan"), "–"),
        (None, "–"),
    ],
)
def test_numbers(value: float | None, text: str) -> None:
    assert number(value) == text


def test_durations() -> None:
    assert [seconds(t) for t in (2.5e-6, 0.0012, 3.0, 200.0)] == [
        "2.50 µs",
        "1.20 ms",
        "3.00 s",
        "3 min 20 s",
    ]


def test_names_are_moved_apart_in_order() -> None:
    places = spread(np.array([10.0, 10.0, 11.0, 90.0]), 12.0, 0.0, 100.0)
    assert (np.diff(places) >= 12 - 1e-9).all()
    assert abs(places[-1] - 90) < 1e-9


def test_a_short_run_starts_in_slow_motion_and_a_long_one_fast() -> None:
    assert [speed for speed, chosen in speeds(10.0) if chosen] == [1.0]
    assert [speed for speed, chosen in speeds(0.1) if chosen] == [0.01]
    assert [speed for speed, chosen in speeds(3600.0) if chosen] == [200.0]


def test_json_cannot_close_its_script() -> None:
    assert "<" not in json_for_html({"label": "</script><!--"})


# ---------------------------------------------------------------- the viewer


def script_of(page: str) -> str:
    return page[page.index("<script>") + len("<script>") : page.rindex("</script>")]


def bare(script: str) -> str:
    """The script without comments and strings (it has no regular expressions)."""
    return re.sub(r"//[^\n]*|\"[^\"\n]*\"|'[^'\n]*'|`[^`]*`", "''", script)


BROWSER = {"DOMPoint", "IntersectionObserver", "ResizeObserver", "Map", "Set"}
BROWSER |= {"Float32Array", "Int16Array", "Int8Array", "Uint16Array", "Uint8Array"}


def test_the_script_is_whole(full_page: str) -> None:
    code = bare(script_of(full_page))
    for opening, closing in ("()", "[]", "{}"):
        assert code.count(opening) == code.count(closing)
    made = set(re.findall(r"new (\w+)\(", code))
    defined = set(re.findall(r"(?:class|function|const) (\w+)", code))
    assert made <= defined | BROWSER
    assert not re.search(r"\b(eval|innerHTML|console|debugger|var)\b", code)


def test_the_page_comes_alive_without_errors(tmp_path: Path, full_page: str) -> None:
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        return test_the_script_is_whole(full_page)
    page = write_report(full_case(times=60), tmp_path / "report.html")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    command += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    command += [
        f"--user-data-dir={tmp_path / 'profile'}",
        "--enable-logging=stderr",
        "--window-size=1200,900",
    ]
    command += ["--virtual-time-budget=3000", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "CONSOLE" not in done.stderr
    assert '<html lang="en" class="alive">' in done.stdout
    assert done.stdout.count('class="cursor" d="M') >= 5
    return None


@pytest.mark.parametrize(("doubt", "mark"), [(1e-12, facts.GOOD), (0.2, facts.DOUBT)])
def test_a_gain_that_its_data_leave_open_is_marked(doubt, mark):
    """A residual at rounding is no praise where the gain is off by a fifth."""
    design = FakeLqr(np.array([-1.0 + 2j, -1.0 - 2j]), 1e-16, doubt)
    (tile,) = (tile for tile in facts.tiles(replace(full_case(), lqr=design)) if tile.label == "LQR residual")
    assert tile.mark == mark


def test_margins_are_shown_with_both_ends_or_with_the_reason():
    """S = 1 - 1/(2(s + 1)): alpha is 2. A loop too large for all inputs says so and shows the weakest input."""
    page = render(full_case())
    assert "disk margin α between" in page
    assert "gain times" in page
    large = Sensitivity(-np.eye(641), np.ones((641, 1)), -np.ones((1, 641)), None)
    design = FakeLqr(np.array([-1.0 + 0j]), 1e-16, sensitivity=large)
    page = render(replace(full_case(), lqr=design))
    assert "left out beyond 640 states: a loop of 641" in page
    assert page.count("α between") == 1
