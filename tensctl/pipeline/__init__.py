"""One call from a scene to its results: what `tensctl run` does."""

from tensctl.pipeline.results import Results
from tensctl.pipeline.run import design, go_on, measure_solvers, run, study, ways

__all__ = ["Results", "design", "go_on", "measure_solvers", "run", "study", "ways"]
