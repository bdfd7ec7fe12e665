"""What a path is like on the way, against single questions asked anew; and whether inertia has time enough."""

import numpy as np
import pytest
from support import replaced, shell_scene

import tensctl as tc
from tensctl.cli import main
from tensctl.simulation import sanity
from tensctl.statics import displacement_under
from tensctl.synthesis import too_quick

SCENE = shell_scene(pins=["P1_*_1"], rods={"radius": 0.01})


@pytest.fixture(scope="module")
def path():
    return tc.plan_shape(SCENE, {"height_scale": 1.2, "start": 0.5, "duration": 2.0}, tension_min=0.1)


@pytest.fixture(scope="module")
def found(path):
    return tc.survey(path, tc.build_dynamics(SCENE))


def test_times_and_shape(path, found):
    assert len(found.stations) == len(path.equilibria)
    assert found.time == pytest.approx(path.time)
    assert str(found).count("\n") == len(path.equilibria)


def test_frequencies_fall_as_it_stretches(path, found):
    for equilibrium, frequency in zip(path.equilibria, found.of("frequency"), strict=True):
        assert frequency == pytest.approx(np.sqrt(equilibrium.omega2.min()) / (2 * np.pi), rel=1e-9)
    assert (np.diff(found.of("frequency")) < 0).all()
    assert found.worst("frequency") is found.stations[-1]


def test_the_softest_node_gives_way_most(path, found):
    """No push on a node of one newton moves it farther; one on the softest moves it just as far."""
    station, rest = found.stations[3], path.equilibria[3]
    labels = rest.structure.node_labels
    largest = {}
    for node, label in enumerate(labels):
        columns = []
        for axis in range(3):
            load = np.zeros_like(rest.nodes)
            load[node, axis] = 1.0
            columns.append(displacement_under(rest, load)[node])
        largest[label] = np.linalg.norm(np.stack(columns, axis=1), 2)
    assert 1 / station.stiffness == pytest.approx(max(largest.values()), rel=1e-9)
    assert largest[station.softest] == pytest.approx(max(largest.values()), rel=1e-9)


def test_tensions(path, found):
    kept = ~path.target.structure.grounded_tendons
    assert found.of("tension") == pytest.approx(path.tensions[:, kept].min(axis=1))
    for station, equilibrium in zip(found.stations, path.equilibria, strict=True):
        assert equilibrium.tensions[path.target.structure.tendon_labels.index(station.slackest)] == station.tension
    resting = found.stations[0], found.stations[-1]
    assert all(station.moving_tension == pytest.approx(station.tension, rel=1e-6) for station in resting)


def test_clearance_is_that_of_a_run(path, found):
    members = path.target.potential.members
    rods = sanity.Segments(path.target.structure.rods, members.radius, np.zeros(len(members.radius)))
    seen = sanity.clearance(path.time, path.nodes, np.zeros_like(path.nodes), rods)
    assert found.of("clearance") == pytest.approx(seen.distance, abs=1e-12)


def test_drive_is_that_of_the_controllability_report(path, found):
    linear = tc.linearize(tc.build_dynamics(SCENE), path.target, outputs=())
    gains = [mode.gain for mode in tc.controllability(linear).modes]
    assert found.stations[-1].drive == pytest.approx(min(gains) / max(gains))
    assert found.stations[-1].undriven == 0


def test_inertia_needs_its_time(path):
    """The time that the sentence asks for is enough, and hardly more than enough."""
    assert too_quick(path, 0.1) is None
    hurried = _paced(path, 0.25)
    sentence = too_quick(hurried, 0.1)
    assert sentence is not None
    assert sentence.startswith("target.duration = 0.25 s is quick for this prestress: inertia would take t")
    needed = float(sentence.split("allow ")[1].split(" s")[0])
    kept = ~path.target.structure.grounded_tendons
    for factor, ok in ((1.01, True), (0.97, False)):
        slower = _paced(path, factor * needed)
        lowest = slower.tensions_at(np.linspace(0.5, 0.5 + slower.duration, 2001))[:, kept].min()
        assert (lowest >= 0.1 - 1e-6) == ok


def _paced(path, duration):
    (leg,) = path.legs
    return replaced(path, legs=(replaced(leg, duration=duration),))


def test_command(tmp_path, capsys):
    """Without a target there is no way to look over."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.to_toml(), encoding="utf-8")
    assert main(["survey", str(scene)]) == 2
    assert "no target is given" in capsys.readouterr().err
    scene.write_text(SCENE.replaced(target={"height_scale": 1.02}).to_toml(), encoding="utf-8")
    assert main(["survey", str(scene)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("height 1.3548 m to 1.3819 m")
    assert said.count("r1_") >= 9
