"""Who is compared: each contender moves a motion from record to record at one setting, building left out.

A setting is a callable without arguments that runs the whole motion and returns the nodes at the record times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca
import mujoco
import numpy as np
from motions import END, TIMES, Motion, RightHandSide
from scipy.integrate import solve_ivp

import tensctl as tc
from tensctl.errors import SimulationError
from tensctl.interop import mjcf, mujoco_state
from tensctl.jit import jit
from tensctl.model.kernel import accelerations

METHODS = ("splitting2", "splitting4", "splitting6", "dopri5", "rosenbrock")
"""Methods of `tc.simulate`; one that this version does not have, or that does not apply, is left out."""
TOLERANCES = tuple(10.0 ** -np.arange(1, 14))


@dataclass(frozen=True, eq=False)
class Setting:
    """One contender at one setting."""

    family: str
    name: str
    setting: str
    run: Callable[[], np.ndarray]


def settings(motion: Motion) -> Iterator[tuple[str, Iterator[Setting]]]:
    """Contenders of a motion, each with its settings from coarse to fine; a contender may be stopped early."""
    for make in (_tensctl, _mujoco, _scipy, _cvodes):
        yield from make(motion)


def _tensctl(motion: Motion) -> Iterator[tuple[str, Iterator[Setting]]]:
    start = (motion.nodes, motion.velocities)

    def recorded(method: Any, tol: float) -> Callable[[], np.ndarray]:
        return lambda: tc.simulate(motion.dynamics, start, timepts=TIMES, method=method, tol=tol).nodes

    def alone(method: Any, tol: float) -> Callable[[], np.ndarray]:
        fly = tc.propagator(motion.dynamics, method=method, tol=tol)
        return lambda: fly(*start, TIMES)[0]

    for method in METHODS:
        try:
            alone(method, 1e-4)()
        except SimulationError:
            continue
        for family, made in (("tensctl", alone), ("tensctl, recorded", recorded)):
            settings = (Setting(family, method, f"tol {tol:.0e}", made(method, tol)) for tol in TOLERANCES)
            yield f"{family} {method}", settings


def _mujoco(motion: Motion) -> Iterator[tuple[str, Iterator[Setting]]]:
    """Steps counted in C: one `mj_step` call between two records.

    Everything that these models have no use for is switched off, in MuJoCo's favour. Its warnings of instability are
    kept quiet: such runs show as errors.
    """
    mujoco.set_mju_user_warning(lambda _: None)
    model = mujoco.MjModel.from_xml_string(mjcf(motion.dynamics))
    for bit in ("CONSTRAINT", "CONTACT", "SENSOR", "ISLAND", "WARMSTART", "CLAMPCTRL", "AUTORESET"):
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{bit}").value
    data = mujoco.MjData(model)
    place, speed = mujoco_state(motion.dynamics, motion.nodes, motion.velocities)
    sites = [model.site(label).id for label in motion.dynamics.structure.node_labels]

    def run(integrator: int, count: int) -> np.ndarray:
        model.opt.integrator = integrator
        model.opt.timestep = END / (len(TIMES) - 1) / count
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = place, speed
        rows = [motion.nodes]
        for _ in TIMES[1:]:
            mujoco.mj_step(model, data, count)
            mujoco.mj_kinematics(model, data)
            rows.append(data.site_xpos[sites])
        return np.stack(rows)

    for name in ("EULER", "IMPLICIT", "IMPLICITFAST", "RK4"):
        integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{name}").value
        counts = (5 * 2**k for k in range(20))
        yield (
            f"MuJoCo {name}",
            (
                Setting("MuJoCo", name, f"h {END / (len(TIMES) - 1) / n:.1e} s", lambda i=integrator, n=n: run(i, n))
                for n in counts
            ),
        )


def _scipy(motion: Motion) -> Iterator[tuple[str, Iterator[Setting]]]:
    numpy_side = RightHandSide(motion.dynamics)
    compiled = _compiled_side(motion)
    methods = ("BDF", "LSODA") if motion.dynamics.damped else ("DOP853", "RK45", "LSODA")

    def run(side: Callable, method: str, tol: float) -> np.ndarray:
        found = solve_ivp(side, (0, END), motion.start, method, TIMES, rtol=max(tol, 2.3e-14), atol=tol)
        if not found.success:
            raise SimulationError(found.message)
        return np.stack([numpy_side.ends(*y.reshape(4, -1, 3)[:2]) for y in found.y.T])

    for family, side in (("SciPy, NumPy", numpy_side), ("SciPy, compiled", compiled)):
        for method in methods:
            yield (
                f"{family} {method}",
                (
                    Setting(family, method, f"tol {tol:.0e}", lambda s=side, m=method, t=tol: run(s, m, t))
                    for tol in TOLERANCES
                ),
            )


@jit
def _rates(data, y, rest, external):
    """Rates of y = (q1, q2, v1, v2) by the kernel."""
    rods = y.size // 12
    blocks = y.reshape((4, rods, 3))
    q, v, a = np.empty((rods, 6)), np.empty((rods, 6)), np.empty((rods, 6))
    q[:, :3], q[:, 3:], v[:, :3], v[:, 3:] = blocks[0], blocks[1], blocks[2], blocks[3]
    accelerations(data, q, v, rest, external, a)
    result = np.empty((4, rods, 3))
    result[0], result[1], result[2], result[3] = v[:, :3], v[:, 3:], a[:, :3], a[:, 3:]
    return result.ravel()


def _compiled_side(motion: Motion) -> Callable[[float, np.ndarray], np.ndarray]:
    kernel, members = motion.dynamics.kernel, motion.dynamics.members
    # SciPy's difference quotients hand over columns of a matrix, which are not contiguous.
    return lambda t, y: _rates(kernel, np.ascontiguousarray(y), members.rest_lengths, members.forces)


def _cvodes(motion: Motion) -> Iterator[tuple[str, Iterator[Setting]]]:
    """SUNDIALS' CVODES through CasADi, on tensctl's own expression of the model, with its exact Jacobian."""
    dynamics, side = motion.dynamics, RightHandSide(motion.dynamics)
    x = ca.SX.sym("x", dynamics.f.size1_in("x"))
    zeros = ca.DM.zeros(dynamics.f.size1_in("u")), ca.DM.zeros(dynamics.f.size1_in("w"))
    problem = {"x": x, "ode": dynamics.f(x, *zeros)}
    start = dynamics.pack(motion.nodes, motion.velocities)

    def make(method: str, iteration: str, tol: float) -> Callable[[], np.ndarray]:
        options = {
            "abstol": tol, "reltol": tol, "linear_multistep_method": method,
            "nonlinear_solver_iteration": iteration, "max_num_steps": 10_000_000,
        }  # fmt: skip
        built = ca.integrator("F", "cvodes", problem, 0.0, TIMES[1:].tolist(), options)

        def run() -> np.ndarray:
            found = np.asarray(built(x0=start)["xf"])
            rods = found[: found.shape[0] // 2].T.reshape(found.shape[1], -1, 2, 3)
            return np.stack([motion.nodes, *(side.ends(*q.transpose(1, 0, 2)) for q in rods)])

        return run

    ways = (("bdf", "newton"),) if dynamics.damped else (("adams", "functional"), ("bdf", "newton"))
    for method, iteration in ways:
        yield (
            f"CVODES {method}",
            (Setting("CVODES", method, f"tol {tol:.0e}", make(method, iteration, tol)) for tol in TOLERANCES),
        )
