"""The errors that tensctl raises on purpose: one class a cause, one clear sentence each.

A sentence says what was given, what was expected and, where it helps, what to try. The command line prints it
as it stands and exits with code 2; anything else that is raised is a fault and keeps its traceback.
"""


class TensctlError(Exception):
    """Any of the errors below; its text is one sentence for the user."""


class SceneError(TensctlError):
    """A scene that cannot be read: the sentence names the key, its value and what is expected."""


class StructureError(TensctlError):
    """A structure that cannot be built, or a label that it does not have."""


class EquilibriumError(TensctlError):
    """A structure that comes to rest nowhere, or nowhere useful."""


class LinearizationError(TensctlError):
    """A model that cannot be linearised where it was asked for."""


class SynthesisError(TensctlError):
    """A controller or a shape path that cannot be found."""


class SimulationError(TensctlError):
    """A run that cannot be started or continued."""


class OutputError(TensctlError):
    """A result that cannot be written where it was asked for."""
