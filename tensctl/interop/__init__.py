"""Doors outward: the model in other tools' formats."""

from tensctl.interop.mat import write_mat
from tensctl.interop.mjcf import mjcf, mujoco_state, write_mjcf

__all__ = ["mjcf", "mujoco_state", "write_mat", "write_mjcf"]
