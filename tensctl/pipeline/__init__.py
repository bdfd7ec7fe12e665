"""One call from a scene to its results: what `tensctl run` does."""

from tensctl.pipeline.results import Results
from tensctl.pipeline.run import go_on, run, study

__all__ = ["Results", "go_on", "run", "study"]
