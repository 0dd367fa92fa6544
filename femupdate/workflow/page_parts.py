"""What all sections of the page are made from, and how they write numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from femupdate.dynamics.system import System
from femupdate.errors import StudyError
from femupdate.inference.posterior import Posterior
from femupdate.storage import read_tree
from femupdate.study import REPAIRED, Artefact, Study
from femupdate.workflow.mesh_error import open_system
from femupdate.workflow.model import StudyModel
from femupdate.workflow.modes import StudyMode, find_modes, posterior_modes
from femupdate.workflow.status import StatusReport
from femupdate.workflow.summary import parameter_titles

_MODES = 6


@dataclass(frozen=True, eq=False)
class PageStudy:
    """A study as the page sees it.

    Attributes:
        study: the folder.
        model: of the study.
        status: what it holds.
        posterior: None where there is none that fits the building.
    """

    study: Study
    model: StudyModel
    status: StatusReport
    posterior: Posterior | None

    @cached_property
    def system(self) -> System:
        """The model with its effects."""
        return open_system(self.study, self.model)

    @cached_property
    def modes(self) -> tuple[StudyMode, ...]:
        """Some modes over the posterior, those that matter most to the data first."""
        if self.posterior is None:
            return ()
        full = find_modes(self.study, self.model)
        return posterior_modes(self.model, self.posterior, full, _MODES)

    @cached_property
    def prediction(self) -> Any:
        """What `predict` kept, as an xarray tree; None where there is nothing.

        Raises:
            StudyError: the file is missing or damaged.
        """
        if self.state("prediction") is None:
            return None
        path = self.study.require("prediction", "predict --record FILE")
        try:
            return read_tree(path)
        except Exception as error:
            raise StudyError(
                f"{path} cannot be read; run `femupdate predict --record FILE` again"
            ) from error

    @cached_property
    def titles(self) -> Mapping[str, str]:
        """What every parameter of the posterior is of."""
        names = () if self.posterior is None else self.posterior.names
        return parameter_titles(self.model.building, names)

    def state(self, name: str) -> str | None:
        """State of a thing that the study may hold, of the posterior that the page shows."""
        return self.status.state(self.study.key(name))

    def recorded(self, name: str) -> Artefact:
        """What the study has recorded of a thing that it holds."""
        return self.study.artefacts()[self.study.key(name)]


def searched(page: PageStudy) -> Study:
    """The study whose diagnosis and repair the page shows."""
    own = page.study
    if own.folder.name == REPAIRED and not own.path("repair.json").exists():
        return Study(own.folder.parent)
    return own
