"""Posterior samples on disk, in the layout of ArviZ InferenceData (netCDF)."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from femupdate.arrays import Floats, Integers
from femupdate.errors import StudyError, brief
from femupdate.inference.diagnostics import Identifiability, identifiability, r_hat
from femupdate.inference.error_draws import ErrorDraws, errors_as_groups, errors_from_groups
from femupdate.inference.event_scatter import LearnedScatter, scatter_as_group, scatter_from_group
from femupdate.inference.parameters import Kind, Parameter, Parameters
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed
from femupdate.storage import check_shapes, read_tree, write_tree

_OF_STRUCTURE: tuple[Kind, ...] = ("stiffness", "effect")
_OF_PRIOR = ("kind", "lower", "upper", "neutral", "centre", "scale")


@dataclass(frozen=True, kw_only=True)
class DrawnBy:
    """How the draws of a posterior came about, and how well they are known.

    Attributes:
        likelihood: "latent" (amortised, by the surrogate) or "exact" (of the data, by the reduced
            model).
        way: of drawing, as in "importance sampling".
        chains: runs that shared nothing; one importance sample counts as one.
        effective_sample_size: of importance draws; None where draws were not weighted.
        log_evidence: of the data; None where the likelihood is latent or the way gives none.
    """

    likelihood: str
    way: str
    chains: int
    evaluations: int
    effective_sample_size: float | None = None
    log_evidence: float | None = None
    log_evidence_error: float | None = None

    @property
    def exact(self) -> bool:
        """Whether the draws are those of the data-space likelihood itself."""
        return self.likelihood == "exact"

    def sentences(self) -> tuple[str, ...]:
        """For the user."""
        told = [f"Drawn by {self.way} ({self.evaluations:,} likelihoods)"]
        if self.effective_sample_size is not None:
            told.append(f"effective sample size {self.effective_sample_size:.0f}")
        if self.log_evidence is not None:
            error = self.log_evidence_error
            told.append(
                f"log evidence {self.log_evidence:.2f}"
                + ("" if error is None else f" ± {error:.2g}")
            )
        return tuple(told)


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """Equally weighted posterior draws.

        >>> import femupdate
        >>> how = {"exact": True, "particles": 400}
        >>> found = femupdate.calibrate("house", "run.csv", building="shear_3dof", **how)
        >>> found.posterior.names, found.posterior.samples.shape
        (('theta_1', 'theta_2', 'theta_3'), (400, 3))

    Attributes:
        parameters: all that a response depends on, known ones among them.
        values: (chains, draws, p) of these; each chain is a run of the sampler of its own, and
            draws that did not run apart are one chain.
        log_likelihood: (chains, draws).
        observation: what it was drawn for.
        model_error: what is known of the error of the model; None where it was not learned.
        scatter: of stiffness and damping between events; None where one run cannot tell.
        warnings: what whoever uses the draws should know, in sentences.
    """

    __repr__ = brief

    parameters: Parameters
    values: Floats
    log_likelihood: Floats
    drawn: DrawnBy
    observation: Observation
    settings: Mapping[str, Any]
    model_error: ErrorDraws | None = None
    scatter: LearnedScatter | None = None
    warnings: tuple[str, ...] = ()

    def of(self, *kinds: Kind) -> "Posterior":
        """The same of some kinds of parameters."""
        draws = self.values[..., self.parameters.columns(*kinds)]
        return replace(self, parameters=self.parameters.of(*kinds), values=draws)

    @property
    def names(self) -> tuple[str, ...]:
        """Those of stiffness factors and of parameters of effects, as all that follows."""
        return self.parameters.of(*_OF_STRUCTURE).names

    @property
    def bounds(self) -> Floats:
        """(p, 2) lower and upper end of their prior."""
        parameters = self.parameters.of(*_OF_STRUCTURE)
        return np.column_stack([parameters.lower, parameters.upper])

    @property
    def theta(self) -> Floats:
        """(chains, draws, p)."""
        return self.values[..., self.parameters.columns(*_OF_STRUCTURE)]

    @property
    def samples(self) -> Floats:
        """All draws (chains x draws, p)."""
        return self.theta.reshape(self.log_likelihood.size, len(self.names))

    @property
    def zeta(self) -> Floats:
        """(chains, draws) damping ratio."""
        return self.values[..., self.parameters.columns("damping")[0]]

    @property
    def zeta_samples(self) -> Floats | None:
        """Damping ratios of all draws; None where the building's law is fixed."""
        return self.zeta.reshape(-1) if self.parameters.of("damping").size else None

    @cached_property
    def r_hat(self) -> Floats | None:
        """(p,) of the independent runs; None where no runs can be compared."""
        return r_hat(self.theta)

    @cached_property
    def identified(self) -> Identifiability:
        """Which combinations of the parameters the data have determined."""
        low, high = self.bounds.T
        return identifiability(self.samples, low, high, self.names)

    def rows(self, count: int, seed: Seed) -> Integers:
        """At most `count` rows of all draws, without replacement."""
        return np.random.default_rng(seed).permutation(self.values[..., 0].size)[:count]

    def thinned(self, count: int, seed: Seed) -> Tensor:
        """At most `count` draws (count, p) of all parameters, without replacement."""
        every = self.values.reshape(-1, self.values.shape[-1])
        return torch.from_numpy(every[self.rows(count, seed)])


def save_posterior(posterior: Posterior, path: Path) -> None:
    """Write netCDF groups `posterior`, `sample_stats`, `observed_data` and `constant_data`."""
    import xarray as xr

    observation, known = posterior.observation, posterior.parameters
    chain_draw = ("chain", "draw")
    coordinates = {
        "chain": np.arange(posterior.values.shape[0]),
        "draw": np.arange(posterior.values.shape[1]),
    }
    each = "floor", "frequency_hz"
    measured: dict[str, Any] = {"valid": (each, observation.valid.astype(np.int8))}
    for name in ("log_frf", "noise_sd", "phase", "coherence", "between", "leaking_sd"):
        if (values := getattr(observation, name)) is not None:
            measured[name] = (each, values)
    if observation.beside is not None:
        parts = np.stack([observation.beside.real, observation.beside.imag])
        measured["beside"] = (("part", "column", "frequency_hz"), parts)
    draws: dict[str, Any] = {"theta": ((*chain_draw, "parameter"), posterior.theta)}
    if posterior.zeta_samples is not None:
        draws["zeta"] = (chain_draw, posterior.zeta)
    stats: dict[str, Any] = {"lp": (chain_draw, posterior.log_likelihood)}
    grid = {"floor": list(observation.floors), "frequency_hz": observation.frequency_hz}
    tree = xr.DataTree.from_dict(
        {
            **errors_as_groups(posterior.model_error, coordinates, grid),
            **scatter_as_group(posterior.scatter, coordinates),
            "/posterior": xr.Dataset(
                draws, coords={**coordinates, "parameter": list(posterior.names)}
            ),
            "/sample_stats": xr.Dataset(stats, coords=coordinates),
            "/observed_data": xr.Dataset(
                measured,
                coords=grid,
                attrs={
                    "source": observation.source,
                    "notes": json.dumps(list(observation.notes)),
                    "resolution_hz": observation.resolution_hz or 0.0,
                },
            ),
            "/constant_data": xr.Dataset(
                {
                    f"prior_{of}": ("parameter", [getattr(entry, of) for entry in known.entries])
                    for of in _OF_PRIOR
                },
                coords={"parameter": list(known.names)},
            ),
        }
    )
    tree.attrs = {
        "drawn_by": json.dumps(asdict(posterior.drawn)),
        "settings": json.dumps(dict(posterior.settings)),
        "warnings": json.dumps(list(posterior.warnings)),
    }
    write_tree(tree, path)


def load_posterior(path: Path) -> Posterior:
    """Read what `save_posterior` wrote.

    Raises:
        StudyError: the file is missing or is not a posterior of femupdate.
    """
    if not Path(path).exists():
        raise StudyError(f"there is no posterior {path}; run `femupdate calibrate` first")
    try:
        posterior = _posterior(read_tree(Path(path)))
        arrays = {"theta": posterior.values, "lp": posterior.log_likelihood}
        shapes = {"theta": "cdp", "lp": "cd"}
        if posterior.scatter is not None:
            arrays |= {"sd": posterior.scatter.sd, "shift": posterior.scatter.shift}
            shapes |= {"sd": "cdq", "shift": "cdq"}
        check_shapes(arrays, shapes)
        # Draws of effects may lie beyond what is likely of their sizes, but never far.
        low, high = posterior.bounds.T
        width = high - low
        beyond = (posterior.theta < low - width) | (posterior.theta > high + width)
        if beyond.any():
            name = posterior.names[int(np.argwhere(beyond)[0, -1])]
            raise ValueError(f"draws of {name} lie outside its prior")
        if not ((posterior.zeta >= 0) & (posterior.zeta < 1)).all():
            raise ValueError("a damping ratio is not from 0 to 1")
        return posterior
    # Bytes that are wrong somewhere make HDF5 and its layers raise errors of every kind.
    except Exception as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise StudyError(
            f"{path} is not a posterior of femupdate ({reason}); run `femupdate calibrate` again"
        ) from error


def _posterior(tree: Any) -> Posterior:
    draws, stats, constants, measured = (
        tree[group].to_dataset()
        for group in ("posterior", "sample_stats", "constant_data", "observed_data")
    )
    if "prior_kind" not in constants or "scatter" in measured:
        raise ValueError("an earlier version wrote it")
    rows = zip(*(constants[f"prior_{of}"].values.tolist() for of in _OF_PRIOR), strict=True)
    known = Parameters(
        tuple(
            Parameter(name=str(name), **dict(zip(_OF_PRIOR, row, strict=True)))
            for name, row in zip(constants["parameter"].values, rows, strict=True)
        )
    )
    theta, (at,) = draws["theta"].values, known.columns("damping")
    if tuple(map(str, draws["parameter"].values)) != known.of(*_OF_STRUCTURE).names:
        raise ValueError("its draws are of other parameters than its prior")
    zeta = known.entries[at].lower + np.zeros(theta.shape[:2])
    if known.entries[at].free:
        zeta = draws["zeta"].values
    check_shapes({"theta": theta, "zeta": zeta}, {"theta": "cdp", "zeta": "cd"})
    values = np.empty((*theta.shape[:2], len(known.entries)))
    values[..., known.columns(*_OF_STRUCTURE)] = theta
    values[..., at] = zeta
    optional = {
        name: measured[name].values
        for name in ("phase", "coherence", "between", "leaking_sd")
        if name in measured
    }
    if "beside" in measured:
        real, imaginary = measured["beside"].values
        optional["beside"] = np.asarray(real + 1j * imaginary)
    return Posterior(
        parameters=known,
        values=values,
        log_likelihood=stats["lp"].values,
        drawn=DrawnBy(**json.loads(tree.attrs["drawn_by"])),
        observation=Observation(
            frequency_hz=measured["frequency_hz"].values,
            floors=tuple(str(name) for name in measured["floor"].values),
            log_frf=measured["log_frf"].values,
            noise_sd=measured["noise_sd"].values,
            valid=measured["valid"].values.astype(bool),
            resolution_hz=float(measured.attrs["resolution_hz"]) or None,
            source=str(measured.attrs["source"]),
            notes=tuple(json.loads(measured.attrs["notes"])),
            **optional,
        ),
        settings=json.loads(tree.attrs["settings"]),
        model_error=errors_from_groups(tree),
        scatter=scatter_from_group(tree),
        warnings=tuple(json.loads(tree.attrs["warnings"])),
    )
