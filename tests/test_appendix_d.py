"""[S]'s own simulation: the (3,1) shell of Appendix D relaxes from a cylinder, critically damped."""

from pathlib import Path

import numpy as np
import pytest

import tensctl as tc
from tensctl.model.damping import damping_matrix
from tensctl.pipeline.results import distance_in_frame
from tensctl.simulation import total_energy

SCENE = tc.load_scene(Path(__file__).parents[1] / "examples" / "appendix_d.toml")


@pytest.fixture(scope="module")
def relaxed(tmp_path_factory):
    """The scene as it stands, through the pipeline: results and folder."""
    folder = tmp_path_factory.mktemp("appendix_d") / "out"
    return tc.run(SCENE, folder), folder


@pytest.fixture(scope="module")
def longer(relaxed):
    return tc.simulate(relaxed[0].dynamics, relaxed[0].structure.nodes, t_end=4.0)


def with_rest_length(rest_length):
    """The scene with another rest length and a drag that needs no equilibrium."""
    tendons = {"stiffness": 100.0, "rest_length": rest_length}
    return SCENE.replaced(tendons=tendons, drag={"coefficient": 8.0})


def test_starts_on_a_cylinder_with_equal_tendons(relaxed):
    run, members = relaxed[0].run, relaxed[0].dynamics.members
    assert np.linalg.norm(run.nodes[0, :, :2], axis=1) == pytest.approx(1.0, abs=1e-12)
    assert (run.velocities[0] == 0).all()
    assert np.ptp(members.stiffness) == np.ptp(members.rest_lengths) == 0
    assert run.inputs.any() == np.False_


def test_ends_at_the_equilibrium(relaxed, longer):
    """Newton's answer and the run's end agree, but for where the free structure stands."""
    rest = tc.find_equilibrium(SCENE)
    assert distance_in_frame(rest, longer)[-1] < 1e-9
    assert np.abs(longer.tensions[-1] - rest.tensions).max() < 1e-6
    assert np.abs(relaxed[0].run.lengths[-1] - rest.lengths).max() < 1e-5


def test_steady_state_in_closed_form(longer):
    """Six rods and 24 equal tendons make the expanded octahedron, whose tendons are sqrt(3/8) of its rods."""
    wanted = np.sqrt(3 / 8) * longer.structure.rod_lengths[0]
    assert np.abs(longer.lengths[-1] - wanted).max() < 1e-9


def test_energy_never_grows(relaxed, longer):
    energy = total_energy(relaxed[0].dynamics, longer)
    assert np.diff(energy).max() < 1e-10 * energy[0]
    assert energy[-1] < energy[0]


class TestCriticalDrag:
    def nudged(self, ratio):
        """Distance from rest along one lowest flexible mode after a small step along it, over time."""
        dynamics = tc.build_dynamics(SCENE.replaced(drag={"coefficient": {"ratio": ratio}}))
        rest = tc.find_equilibrium(SCENE)
        manifold, spectrum = rest.potential.manifold, rest.spectrum
        shape = spectrum.shapes[:, spectrum.rigid_count]
        run = tc.simulate(
            dynamics, manifold.retract(rest.nodes, 1e-5 * shape), timepts=np.linspace(0, 1, 101), tol=1e-12
        )
        weight = shape * manifold.mass(dynamics.members.mass)
        return run.time, np.array([weight @ manifold.logarithm(rest.nodes, nodes) for nodes in run.nodes]) / 1e-5

    def test_modal_ratio_is_one(self, relaxed):
        dynamics, rest = relaxed[0].dynamics, relaxed[0].equilibrium
        matrix = damping_matrix(rest.point, 0 * rest.tensions, dynamics.drag)
        first = rest.spectrum.rigid_count
        shapes, omega = rest.spectrum.shapes[:, first : first + 3], np.sqrt(rest.omega2[first])
        assert rest.omega2[first + 2] == pytest.approx(omega**2, rel=1e-9)
        assert np.trace(shapes.T @ (matrix @ shapes)) / 3 / (2 * omega) == pytest.approx(1.0, rel=1e-10)

    def test_lowest_mode_does_not_oscillate(self, relaxed):
        """It decays without a change of sign, in the end at the rate of a real pole; at half the drag it swings."""
        time, amplitude = self.nudged(1.0)
        assert amplitude[0] == pytest.approx(1.0, rel=1e-4)
        assert amplitude.min() > 0
        late = (time > 0.5) & (time < 0.9)
        rate = np.polyfit(time[late], np.log(amplitude[late]), 1)[0]
        linear = tc.linearize(relaxed[0].dynamics, relaxed[0].equilibrium, outputs=())
        poles = np.linalg.eigvals(linear.A)
        real = np.sort(poles.real[np.abs(poles.imag) < 1e-6])
        assert np.abs(real[-6:]).max() < 1e-6, "where the shell stands is nobody's business"
        assert rate == pytest.approx(real[-7], rel=2e-3)
        _, half = self.nudged(0.5)
        assert half.min() < -0.05


class TestRestLengths:
    @pytest.mark.parametrize("rest_length", [0.3, 0.9])
    def test_taut_and_stable(self, rest_length):
        scene = with_rest_length(rest_length)
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=5.0)
        assert str(rest.stable) == "yes"
        assert rest.tensions.min() > 9.0
        assert np.abs(run.tensions[-1] - rest.tensions).max() < 1e-4

    def test_all_slack(self):
        scene = with_rest_length(1.1)
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=5.0)
        assert str(tc.find_equilibrium(scene).stable) == "no prestress"
        assert (run.tensions[-1] == 0).all()
        assert tc.inspect_run(dynamics, run).slack[-1] == 1.0

    def test_on_the_way_to_slack(self):
        """At 1.0 m, a millimetre more than the steady state's tendons, tension fades as stiffness does."""
        scene = with_rest_length(1.0)
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=[0.0, 2.0, 4.0, 8.0])
        assert str(tc.find_equilibrium(scene).stable) == "no prestress"
        largest = run.tensions.max(axis=1)
        assert (np.diff(largest) < 0).all()
        assert largest[-1] < 0.1


def test_report_has_the_three_figures(relaxed):
    """The start (Fig. 10), the steady state (Fig. 11), tendon lengths over time (Fig. 12)."""
    page = (relaxed[1] / "report.html").read_text(encoding="utf-8")
    for title in ("At the start", "After 1.5 s", "Tendon length, m"):
        assert title in page
    assert relaxed[0].sanity.warnings == ()
