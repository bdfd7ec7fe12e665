"""Choose motors for the (3,1) mast of `shell_3_1.toml`: what its path asks of them, and what a run under MPC does."""

from pathlib import Path

import numpy as np

import tensctl as tc

scene = tc.load_scene(Path(__file__).with_name("shell_3_1.toml"))
rest, dynamics = tc.find_equilibrium(scene), tc.build_dynamics(scene)

path = tc.plan_shape(scene, start=rest)
planned, slow = tc.actuator_demand(path), tc.actuator_demand(path, inertia=False)
slow.verify()
print(f"{path.description}\n{planned}\ninfinitely slow: work off the change of energy by {abs(slow.balance):.1e} J\n")

controller = tc.MPC(tc.linearize(dynamics, path.target, outputs=()), tension_min=0.1, path=path)
for samples in (1, 2, 4):  # recorded so many times in each control period
    times = np.linspace(0.0, 5.0, 250 * samples + 1)
    run = tc.simulate(dynamics, rest, controller=controller, timepts=times)
    demand = tc.actuator_demand(run, dynamics)
    demand.verify()
    print(
        f"{len(times):5d} times: net work {demand.work.net.sum():.9f} J, off the change of energy by "
        f"{abs(demand.balance):.1e} J; strongest motor {demand.peak_power.value.max():.4f} W, all "
        f"{demand.peak_supply[0]:.4f} W"
    )

# Motors that stall at 13 N: the start needs 12.97 N, the free target 13.11 N. The path finds another way.
weaker = scene.replaced(actuators={"force_max": 13.0})
limited = tc.plan_shape(weaker, start=tc.find_equilibrium(weaker))
for name, way in (("free", path), ("at most 13 N", limited)):
    asked = tc.actuator_demand(way)
    moved = np.linalg.norm(way.target.inputs)
    print(f"{name:12}: largest force {asked.peak_force.value.max():.3f} N, rest lengths change by {moved:.6f} m (norm)")
