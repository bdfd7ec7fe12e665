"""Build a shell, linearise it, and hand the model to python-control: poles, LQR, step response, its own plots.

Run it with `python examples/lqr_with_python_control.py`; it writes `lqr_step.svg` beside itself or into the folder
given as its argument.
"""

import sys
from pathlib import Path

import control as ct
import matplotlib as mpl
import numpy as np

import tensctl as tc

mpl.use("svg")

# A free (3,1) shell: 6 rods, 24 tendons, nothing holds it.
scene = tc.Scene(
    structure=tc.shell(3, 1),
    rods={"mass": 1.0},
    tendons={"stiffness": 100.0, "rest_ratio": 0.8},
)
rest = tc.find_equilibrium(scene)
print(f"rest: {rest.stable}, residual {rest.residual:.1e}, energy {rest.energy:.3f} J")

linear = tc.linearize(tc.build_dynamics(scene), rest, outputs=["nodes", "tensions"])
report = tc.controllability(linear)
print(f"{len(report.controllable_modes)} of {len(linear.modes)} modes are driven by tendons")
for mode in report.modes[:2]:
    print(f"  mode {mode.index}: {mode.reason}")

# The flexible part as a labelled control.StateSpace; 6 rigid-body motions are no tendon's business.
plant = linear.flexible.to_statespace()
print(f"plant: {plant.nstates} states, {plant.ninputs} inputs, {plant.noutputs} outputs")
print(
    f"open loop: fastest pole {np.abs(plant.poles()).max():.2f} rad/s, damping {-np.real(plant.poles()).max():.1e} 1/s"
)

# The same weights in both: twice the energy, and k u^2.
own = tc.lqr(linear)
K, _, poles = ct.lqr(plant, own.Q, own.R)
print(f"gains differ by {np.abs(K - own.K).max() / np.abs(K).max():.1e}, slowest pole {np.real(poles).max():.3f} 1/s")

# Shorten one tendon's command by 10 mm in closed loop and look at one node.
loop = ct.StateSpace(plant.A - plant.B @ K, plant.B, plant.C - plant.D @ K, plant.D, name="closed_loop")
loop.update_names(inputs=plant.input_labels, outputs=plant.output_labels)
tendon, node = loop.input_labels.index("u_t5_1_1"), loop.output_labels.index("P4_1_1_z")
response = ct.step_response(0.01 * loop[node, tendon], timepts=np.linspace(0, 6, 400))
print(f"P4_1_1 settles at z {1e3 * response.y[0, 0, -1]:+.3f} mm")

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
figure = response.plot(title="P4_1_1 after t5_1_1 is shortened by 10 mm").figure
figure.savefig(folder / "lqr_step.svg")
print(f"written: {folder / 'lqr_step.svg'}")
