"""Doors outward: the model in other tools' formats."""

from tensctl.interop.mat import write_mat

__all__ = ["write_mat"]
