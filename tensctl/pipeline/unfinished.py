"""A run that goes to disk chunk by chunk under its result folder, and from there on after a break.

`OUT/unfinished` holds the scene, so that the stages before the run can be gone through again, and `run.nc` with what
has been recorded. It goes when all results are in place.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from tensctl.atomic import UNFINISHED
from tensctl.errors import OutputError, SimulationError

if TYPE_CHECKING:
    from tensctl.model import Dynamics
    from tensctl.scene import Scene
    from tensctl.simulation import Controller, Run
    from tensctl.simulation.course import Counter

_SCENE, _RUN = "scene.toml", "run.nc"


@dataclass(frozen=True)
class Unfinished:
    """The folder of an unfinished run, whether it is there or not."""

    folder: Path

    @classmethod
    def under(cls, out: str | Path) -> Unfinished:
        """That of a result folder."""
        return cls(Path(out).resolve() / UNFINISHED)

    @property
    def begun(self) -> bool:
        """Whether a chunk is on disk."""
        return (self.folder / _RUN).is_file()

    def refuse_if_begun(self) -> None:
        """Keep what is there from being thrown away.

        Raises
        ------
        OutputError
            When there is a chunk.
        """
        if self.begun:
            out = self.folder.parent
            raise OutputError(
                f"{out} holds an unfinished run; go on with it (tensctl resume {out}), or remove {self.folder}."
            )

    def scene(self) -> Scene:
        """The scene of the run.

        Raises
        ------
        SimulationError
            When there is no unfinished run.
        """
        from tensctl.scene import load_scene

        if not (self.folder / _SCENE).is_file():
            raise SimulationError(
                f"{self.folder.parent} holds no unfinished run; one that tensctl run began with simulation.store = true"
                " and did not end is expected."
            )
        return load_scene(self.folder / _SCENE)

    def run(
        self, scene: Scene, dynamics: Dynamics, controller: Controller | None, progress: Counter,
        anew: Callable[[Path], Run],
    ) -> Run:  # fmt: skip
        """The whole run: `anew(path)` stores it from its start, unless there are chunks to go on from."""
        from tensctl.simulation import Run, resume
        from tensctl.simulation.store import is_complete

        path = self.folder / _RUN
        if not self.begun:
            with self._made(scene):
                anew(path)
        elif not is_complete(path):
            resume(dynamics, path, controller=controller, progress=progress)
        return replace(Run.load(path), structure=dynamics.structure)

    def remove(self) -> None:
        """Forget it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @contextmanager
    def _made(self, scene: Scene) -> Iterator[None]:
        """The folder with its scene; it goes again when the run stops before its first chunk is on disk."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            (self.folder / _SCENE).write_text(scene.to_toml(), encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{self.folder} cannot be written: {error.strerror or error}.") from None
        try:
            yield
        except BaseException:
            if not self.begun:
                self.remove()
            raise
