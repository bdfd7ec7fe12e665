"""What is compiled is compiled when a predictive controller is made: in a new process, where no kernel is ready."""

import subprocess
import sys

import pytest

LOOK = """
import sys

import tensctl as tc
from numba.core.dispatcher import Dispatcher


def kernels():
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("tensctl")]
    return {(m.__name__, k): len(v.overloads) for m in modules for k, v in vars(m).items() if isinstance(v, Dispatcher)}


scene = tc.Scene(structure={"kind": "shell", "n": 3, "m": 1, "pins": ["P1_*_1"]})
dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
linear = tc.linearize(dynamics, rest, outputs=())
floor = float(sys.argv[2])
controller = {
    "nonlinear": lambda: tc.NonlinearMPC(dynamics, rest, horizon=3, delay=0.01, tension_min=floor),
    "states": lambda: tc.MPC(linear, horizon=8, tension_min=floor),
}[sys.argv[1]]()
look = tc.Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
before = kernels()
for k in range(2):
    controller.step(0.02 * k, look)
print(controller.records[-1].status, [name for name, count in kernels().items() if count != before.get(name, 0)])
"""


@pytest.mark.parametrize("model", ["nonlinear", "states"])
def test_no_step_compiles(model):
    """Floors of 12 N give way, so all that is asked in turn is asked."""
    done = subprocess.run([sys.executable, "-c", LOOK, model, "12"], capture_output=True, text=True, check=True)
    status, _, compiled = done.stdout.strip().rpartition(" [")
    assert status.split()[0] in ("primal", "piqp")
    assert compiled == "]"
