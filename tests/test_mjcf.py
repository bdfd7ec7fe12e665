"""MuJoCo, given the exported model, accelerates and moves as tensctl does: an independent engine as judge."""

import mujoco
import numpy as np
import pytest
from support import MIXED_PINS, mast_scene, network_scene, order_of, prism_scene, random_motion, shell_scene, solved

import tensctl as tc
from tensctl.cli import main
from tensctl.errors import OutputError, StructureError
from tensctl.interop import mjcf, mujoco_state, write_mjcf
from tensctl.model.kernel import accelerations

SCENES = {
    "shell": shell_scene(),
    "pins": shell_scene(pins=MIXED_PINS, gravity={"g": [1.0, -2.0, -9.8]}),
    "EA": shell_scene(4, 2, tendons={"EA": 150.0, "rest_ratio": 0.9}),
    "loads and drag": prism_scene(loads={"*": [0.3, -0.2, 0.5]}, drag={"coefficient": 0.7}, pins=["a1"]),
    "cables": mast_scene(tendons={"EA": 150.0, "rest_ratio": 0.9}),
    "cables with dampers": mast_scene(["P1_*_1"], tendons={"rest_ratio": 0.4, "damping": 0.5}),
    "dampers": shell_scene(tendons={"rest_ratio": 0.4, "damping": 0.5}, pins=["P1_*_1"]),
}


def model_of(dynamics):
    model = mujoco.MjModel.from_xml_string(mjcf(dynamics))
    return model, mujoco.MjData(model)


def place(dynamics, data, nodes, velocities):
    data.qpos[:], data.qvel[:] = mujoco_state(dynamics, nodes, velocities)


def nodes_of(dynamics, data):
    """Node positions as MuJoCo has them, found by label."""
    return np.stack([data.site(label).xpos for label in dynamics.structure.node_labels])


def rod_accelerations(dynamics, model, data):
    """Accelerations of tail plus head and of head less tail, (nr, 6), from MuJoCo's qacc.

    A point at r from the body's origin: a + alpha x r + omega x (omega x r), angular parts turned from the body's axes.
    """
    result = np.zeros((len(dynamics.structure.rods), 6))
    for k, (label, ends) in enumerate(zip(dynamics.structure.rod_labels, dynamics.structure.rods, strict=True)):
        body = model.body(label).id if label in {model.body(i).name for i in range(model.nbody)} else 0
        if body == 0:
            continue
        first, free = model.body_dofadr[body], model.body_dofnum[body] == 6
        turn = data.xmat[body].reshape(3, 3)
        base = data.qacc[first : first + 3] if free else np.zeros(3)
        at = first + 3 * free
        alpha, omega = turn @ data.qacc[at : at + 3], turn @ data.qvel[at : at + 3]
        tail, head = (
            base + np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
            for r in (data.site(dynamics.structure.node_labels[i]).xpos - data.xpos[body] for i in ends)
        )
        result[k] = np.concatenate([tail + head, head - tail])
    return result


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_accelerations_agree_to_rounding(scene, rng):
    dynamics = tc.build_dynamics(scene)
    members, structure = dynamics.members, dynamics.structure
    model, data = model_of(dynamics)
    slack = taut = 0
    for _ in range(20):
        nodes, velocities = random_motion(dynamics.potential, rng, reach=0.02 if dynamics.damping.any() else 0.3)
        place(dynamics, data, nodes, velocities)
        mujoco.mj_forward(model, data)
        assert np.abs(nodes_of(dynamics, data) - nodes).max() < 1e-14
        q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
        wanted = np.zeros_like(q)
        accelerations(dynamics.kernel, q, v, members.rest_lengths, members.forces, wanted)
        assert np.abs(rod_accelerations(dynamics, model, data) - wanted).max() < 1e-13 * np.abs(wanted).max()
        slack += (structure.lengths_at(nodes) < members.rest_lengths).sum()
        taut += (structure.lengths_at(nodes) > members.rest_lengths).sum()
    assert taut > 0
    assert slack > 0 or dynamics.damping.any(), "dampers agree while taut only"
    assert slack == 0 or not dynamics.damping.any()


def closing_in(dynamics, run, steps):
    """Distances between MuJoCo's Runge-Kutta runs and tensctl's at the end of it, m."""
    model, data = model_of(dynamics)
    errors = []
    for count in steps:
        mujoco.mj_resetData(model, data)
        place(dynamics, data, run.nodes[0], run.velocities[0])
        model.opt.timestep = run.time[-1] / count
        mujoco.mj_step(model, data, int(count))
        mujoco.mj_kinematics(model, data)
        errors.append(np.abs(nodes_of(dynamics, data) - run.nodes[-1]).max())
    return np.array(errors)


def test_taut_trajectories_agree(rng):
    """MuJoCo's Runge-Kutta closes in on tensctl's run with its order 4, down to rounding of thousands of steps."""
    dynamics, rest, _ = solved(shell_scene(tendons={"rest_ratio": 0.5}, pins=MIXED_PINS))
    motion = rest.point.tangent @ (0.3 * rng.standard_normal(rest.potential.manifold.size))
    run = tc.simulate(dynamics, (rest.nodes, motion.reshape(-1, 3)), timepts=[0.0, 0.2], tol=1e-12)
    assert run.switches == 0
    steps = np.array([25, 50, 100])
    assert order_of(0.2 / steps, closing_in(dynamics, run, steps)) == pytest.approx(4, abs=0.3)
    assert closing_in(dynamics, run, [2000]) < 1e-11


def test_switching_trajectories_agree():
    """Every switch inside a step costs Runge-Kutta its order but one: second order is what is left."""
    dynamics = tc.build_dynamics(SCENES["pins"])
    run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=[0.0, 0.2], tol=1e-12)
    assert run.switches > 0
    errors = closing_in(dynamics, run, [100, 10_000])
    assert errors[1] < 1e-8
    assert errors[0] > 100 * errors[1]


def test_spin_inertia_moves_no_node(rng):
    """Ten times the inertia about the rods' axes changes nothing."""
    dynamics = tc.build_dynamics(SCENES["shell"])
    nodes, velocities = random_motion(dynamics.potential, rng)
    ends = []
    for factor in (1.0, 10.0):
        model, data = model_of(dynamics)
        model.body_inertia[1:, 2] *= factor
        place(dynamics, data, nodes, velocities)
        model.opt.timestep = 1e-3
        mujoco.mj_step(model, data, 200)
        mujoco.mj_kinematics(model, data)
        ends.append(nodes_of(dynamics, data))
    assert np.abs(ends[1] - nodes).max() > 0.01
    assert np.abs(ends[1] - ends[0]).max() < 1e-12


def test_equilibrium_is_a_keyframe(tmp_path):
    scene = shell_scene(pins=["P1_*_1"], equilibrium={}, title="a mast")
    model = mujoco.MjModel.from_xml_path(str(write_mjcf(scene, tmp_path / "mast.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("equilibrium").id)
    mujoco.mj_forward(model, data)
    rest = tc.find_equilibrium(scene)
    assert np.abs(nodes_of(tc.build_dynamics(scene), data) - rest.nodes).max() < 1e-14
    assert np.abs(data.qacc).max() < 1e-8


def test_pushes_are_controls():
    push = {"node": "P4_1_1", "force": [5, 0, 0], "from": 0.0, "to": 0.1}
    scene = shell_scene(simulation={"t_end": 1.0, "push": [push]})
    dynamics = tc.build_dynamics(scene)
    model, data = model_of(dynamics)
    assert [model.actuator(i).name for i in range(model.nu)] == ["P4_1_1.x", "P4_1_1.y", "P4_1_1.z"]
    nodes = dynamics.structure.nodes
    place(dynamics, data, nodes, 0 * nodes)
    data.ctrl[:] = 5, -2, 1
    mujoco.mj_forward(model, data)
    force = dynamics.members.forces.copy()
    force[dynamics.structure.node_labels.index("P4_1_1")] += data.ctrl
    q, wanted = dynamics.rod_coordinates(nodes), np.zeros((6, 6))
    accelerations(dynamics.kernel, q, 0 * q, dynamics.members.rest_lengths, force, wanted)
    assert np.abs(rod_accelerations(dynamics, model, data) - wanted).max() < 1e-13 * np.abs(wanted).max()


@pytest.mark.parametrize("head", [(0, 0, 1.0), (0, 0, -1.0), (1e-9, 0, -1.0), (0.3, -0.5, 0.2), (1.0, 0, -0.5)])
def test_rods_in_every_direction(head):
    """Upside down too, where the quaternion that turns z to the rod is ill defined."""
    scene = network_scene(
        {"a": [0, 0, 0], "b": list(head), "c": [2, 2, 2]}, {"r": ["a", "b"]}, {"t": ["b", "c"]}, ["c"]
    )
    dynamics = tc.build_dynamics(scene)
    _, data = model_of(dynamics)
    velocities = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 0]])
    place(dynamics, data, dynamics.structure.nodes, velocities)
    model, _ = model_of(dynamics)
    mujoco.mj_kinematics(model, data)
    assert np.abs(nodes_of(dynamics, data) - dynamics.structure.nodes).max() < 1e-15


def test_joints_are_refused(tmp_path):
    with pytest.raises(StructureError, match="share a node"):
        write_mjcf(shell_scene(3, 2, cls=2, overlap=0.5, twist=2 * np.pi / 3), tmp_path / "x.xml")


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        write_mjcf(SCENES["shell"], tmp_path / "no" / "x.xml")


def test_command(tmp_path, capsys):
    scene = tmp_path / "mast.toml"
    scene.write_text(SCENES["pins"].to_toml())
    assert main(["export", str(scene), "-o", str(tmp_path / "mast.xml")]) == 0
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "mast.xml")).ntendon == 24
    assert "written" in capsys.readouterr().out
