"""Controllers as C source that runs on its own: no allocation, no library but the mathematics of C."""

from tensctl.codegen.export_c import CSource, export_c

__all__ = ["CSource", "export_c"]
