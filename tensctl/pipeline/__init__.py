"""One call from a scene to its results: what `tensctl run` does."""

from tensctl.pipeline.results import Results
from tensctl.pipeline.run import run, study

__all__ = ["Results", "run", "study"]
