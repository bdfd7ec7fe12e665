"""One call from a scene to its results: what `tensctl run` does."""

from tensctl.pipeline.results import Results
from tensctl.pipeline.run import design, foretold, go_on, measure_solvers, needed, run, study

__all__ = ["Results", "design", "foretold", "go_on", "measure_solvers", "needed", "run", "study"]
