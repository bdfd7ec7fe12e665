"""The sparse second-order form says the same as A, B, C, D, and needs no modes."""

import time

import numpy as np
import pytest
from linear_support import SCENES
from support import replaced, shell_scene, solved
from threadpoolctl import threadpool_limits

import tensctl as tc


def transfer_by_modes(linear, s):
    both = np.hstack([linear.B, linear.E])
    through = np.hstack([linear.D, np.zeros((len(linear.outputs), linear.E.shape[1]))])
    return linear.C @ np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, both) + through


def transfer_by_sparse(form, s):
    stiffness = (s**2 * form.M + s * form.C + form.K).toarray()
    force = np.hstack([form.G.toarray(), form.W.toarray()])
    answer = (form.P + s * form.V) @ np.linalg.solve(stiffness, force)
    answer[:, : form.F.shape[1]] += form.F.toarray()
    return answer


@pytest.mark.parametrize("name", SCENES)
def test_same_answer_to_every_input(name):
    """y/u and y/w at complex frequencies, through two different sets of matrices."""
    dynamics, rest, _ = solved(SCENES[name])
    outputs = ("nodes", "velocities", "lengths", "tensions")
    linear = tc.linearize(dynamics, rest, outputs=outputs, loads=[dynamics.structure.node_labels[-1]])
    for s in (0.7 + 2j, 5.0 - 11j, 40.0 + 1j):
        one, other = transfer_by_modes(linear, s), transfer_by_sparse(linear.sparse, s)
        assert np.abs(one - other).max() < 1e-10 * np.abs(other).max()


@pytest.mark.parametrize("name", SCENES)
def test_verify(name):
    form = solved(SCENES[name])[2].sparse
    form.verify()
    assert abs(form.K - form.K.T).max() < 1e-13 * abs(form.K).max()
    with pytest.raises(tc.LinearizationError, match="K misses the energy"):
        replaced(form, K=1.01 * form.K).verify()


@pytest.fixture(scope="module", params=["(20,10)", "(50,40)"])
def large(request):
    scene, limit = {
        "(20,10)": (shell_scene(20, 10, overlap=0.15), 0.3),
        "(50,40)": (shell_scene(50, 40, radius=1.25, overlap=0.05, twist=1.6, tendons={"rest_ratio": 0.9}), 5.0),
    }[request.param]
    rest = tc.find_equilibrium(scene)
    assert (rest.tensions > 0).all()
    return tc.build_dynamics(scene), replaced(rest), limit


class TestLarge:
    """Nothing dense is made, and no modes are looked for."""

    def test_is_fast(self, large):
        dynamics, rest, limit = large
        with threadpool_limits(1):
            began = time.process_time()
            form = tc.linearize(dynamics, rest).sparse
            assert time.process_time() - began < limit
        assert "spectrum" not in rest.__dict__, "no modes were asked for"
        for part in (form.M, form.C, form.K, form.G, form.P, form.F):
            assert part.nnz < 80 * form.size
        form.verify()

    def test_static_reach_is_that_of_the_statics(self, large):
        """K xi = G u, one column, against the response that statics computes with rigid-body motions bordered."""
        from tensctl.statics import static_influence

        dynamics, rest, _ = large
        form, tendon = tc.linearize(dynamics, rest).sparse, 7
        xi = static_influence(rest, np.array([tendon]))[:, 0]
        force = form.G[:, [tendon]].toarray().ravel()
        assert np.abs(form.K @ xi - force).max() < 1e-8 * np.abs(force).max()


def test_modes_of_a_large_structure_are_refused_when_asked_for():
    scene = shell_scene(20, 11, overlap=0.15)
    linear = tc.linearize(tc.build_dynamics(scene), tc.find_equilibrium(scene))
    assert linear.sparse.size == 2200
    for ask in (lambda: linear.A, lambda: linear.modes[0], lambda: linear.flexible):
        with pytest.raises(tc.LinearizationError, match=r"2200 degrees of freedom.*take linear\.sparse"):
            ask()
