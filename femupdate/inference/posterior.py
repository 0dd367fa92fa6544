"""Posterior samples on disk, in the layout of ArviZ InferenceData (netCDF)."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.array_archive import check_shapes
from femupdate.arrays import Complexes, Floats, Integers
from femupdate.errors import StudyError
from femupdate.inference.error_draws import ErrorDraws, errors_as_groups, errors_from_groups
from femupdate.inference.event_scatter import (
    LearnedScatter,
    scatter_as_group,
    scatter_from_group,
)
from femupdate.measurement.observation import Observation
from femupdate.netcdf import read_tree, write_tree
from femupdate.seeds import Seed


@dataclass(frozen=True, kw_only=True)
class DrawnBy:
    """How the draws of a posterior came about, and how well they are known.

    Attributes:
        likelihood: "latent" (amortised, by the surrogate) or "exact" (of the data, by the reduced
            model).
        way: of drawing, as in "importance sampling".
        chains: runs that shared nothing; one importance sample counts as one.
        evaluations: of the likelihood.
        effective_sample_size: of importance draws; None where draws were not weighted.
        log_evidence: of the data; None where the likelihood is latent or the way gives none.
        log_evidence_error: its standard error, likewise.
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
        told = [f"drawn by {self.way} ({self.evaluations:,} likelihoods)"]
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

    Attributes:
        names: p names of the stiffness factors.
        theta: (chains, draws, p); each chain is a run of the sampler of its own, and draws that
            did not run apart are one chain.
        zeta: (chains, draws) damping ratio, or None where the building's law is fixed.
        log_likelihood: (chains, draws).
        lower, upper: (p,) prior box.
        drawn: how.
        observation: what it was drawn for.
        settings: of the sampler.
        model_error: what is known of the error of the model; None where it was not learned.
        scatter: of stiffness and damping between events; None where one run cannot tell.
        warnings: what whoever uses the draws should know, in sentences.
    """

    names: tuple[str, ...]
    theta: Floats
    zeta: Floats | None
    log_likelihood: Floats
    lower: Floats
    upper: Floats
    drawn: DrawnBy
    observation: Observation
    settings: Mapping[str, Any]
    model_error: ErrorDraws | None = None
    scatter: LearnedScatter | None = None
    warnings: tuple[str, ...] = ()

    @property
    def samples(self) -> Floats:
        """All draws (chains x draws, p)."""
        return self.theta.reshape(-1, self.theta.shape[-1])

    @property
    def zeta_samples(self) -> Floats | None:
        """Damping ratios of all draws."""
        return None if self.zeta is None else self.zeta.reshape(-1)

    def rows(self, count: int, seed: Seed) -> Integers:
        """At most `count` rows of all draws, without replacement."""
        return np.random.default_rng(seed).permutation(len(self.samples))[:count]

    def thinned(self, count: int, seed: Seed) -> tuple[Floats, Floats | None]:
        """At most `count` draws of theta (count, p) and zeta (count,), without replacement."""
        rows, zeta = self.rows(count, seed), self.zeta_samples
        return self.samples[rows], None if zeta is None else zeta[rows]


def save_posterior(posterior: Posterior, path: Path) -> None:
    """Write netCDF groups `posterior`, `sample_stats`, `observed_data` and `constant_data`."""
    import xarray as xr

    observation = posterior.observation
    chain_draw = ("chain", "draw")
    coordinates = {
        "chain": np.arange(posterior.theta.shape[0]),
        "draw": np.arange(posterior.theta.shape[1]),
    }
    draws: dict[str, Any] = {"theta": ((*chain_draw, "parameter"), posterior.theta)}
    if posterior.zeta is not None:
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
                _measured(observation),
                coords=grid,
                attrs={
                    "source": observation.source,
                    "notes": json.dumps(list(observation.notes)),
                    "resolution_hz": observation.resolution_hz or 0.0,
                },
            ),
            "/constant_data": xr.Dataset(
                {
                    "prior_lower": ("parameter", posterior.lower),
                    "prior_upper": ("parameter", posterior.upper),
                },
                coords={"parameter": list(posterior.names)},
            ),
        }
    )
    tree.attrs = {
        "drawn_by": json.dumps(asdict(posterior.drawn)),
        "settings": json.dumps(dict(posterior.settings)),
        "warnings": json.dumps(list(posterior.warnings)),
    }
    write_tree(tree, path)


def _measured(observation: Observation) -> dict[str, Any]:
    """The variables of an observation, with their dimensions."""
    each = "floor", "frequency_hz"
    known = {
        "log_frf": observation.log_frf,
        "noise_sd": observation.noise_sd,
        "valid": observation.valid.astype(np.int8),
        "phase": observation.phase,
        "coherence": observation.coherence,
        "scatter": observation.scatter,
    }
    measured: dict[str, Any] = {
        name: (each, values) for name, values in known.items() if values is not None
    }
    if observation.rotation is not None:
        parts = np.stack([observation.rotation.real, observation.rotation.imag])
        measured["rotation"] = (("part", "frequency_hz"), parts)
    return measured


def load_posterior(path: Path) -> Posterior:
    """Read what `save_posterior` wrote.

    Raises:
        StudyError: the file is missing or is not a posterior of femupdate.
    """
    if not Path(path).exists():
        raise StudyError(f"there is no posterior {path}; run `femupdate calibrate` first")
    try:
        posterior = _posterior(read_tree(Path(path)))
        _check(posterior)
        return posterior
    # Bytes that are wrong somewhere make HDF5 and its layers raise errors of every kind.
    except Exception as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise StudyError(
            f"{path} is not a posterior of femupdate ({reason}); run `femupdate calibrate` again"
        ) from error


def _check(posterior: Posterior) -> None:
    """Refuse draws that no sampler of ours has made.

    Raises:
        ValueError: shapes do not go together, a value is not finite, or a draw is far from the
            prior box.
    """
    arrays = {
        "theta": posterior.theta,
        "lp": posterior.log_likelihood,
        "prior_lower": posterior.lower,
        "prior_upper": posterior.upper,
    }
    shapes = {"theta": "cdp", "lp": "cd", "prior_lower": "p", "prior_upper": "p"}
    if posterior.scatter is not None:
        arrays = {**arrays, "sd": posterior.scatter.sd, "shift": posterior.scatter.shift}
        shapes = {**shapes, "sd": "cdq", "shift": "cdq"}
    if posterior.zeta is not None:
        arrays, shapes = {**arrays, "zeta": posterior.zeta}, {**shapes, "zeta": "cd"}
    check_shapes(arrays, shapes)
    # Draws of effects may lie beyond what is likely of their sizes, but never far.
    width = posterior.upper - posterior.lower
    beyond = (posterior.theta < posterior.lower - width) | (
        posterior.theta > posterior.upper + width
    )
    if beyond.any():
        name = posterior.names[int(np.argwhere(beyond)[0, -1])]
        raise ValueError(f"draws of {name} lie outside its prior")
    if posterior.zeta is not None and not ((posterior.zeta >= 0) & (posterior.zeta < 1)).all():
        raise ValueError("a damping ratio is not from 0 to 1")


def _posterior(tree: Any) -> Posterior:
    draws, stats, constants, measured = (
        tree[group].to_dataset()
        for group in ("posterior", "sample_stats", "constant_data", "observed_data")
    )
    return Posterior(
        names=tuple(str(name) for name in draws["parameter"].values),
        theta=draws["theta"].values,
        zeta=draws["zeta"].values if "zeta" in draws else None,
        log_likelihood=stats["lp"].values,
        lower=constants["prior_lower"].values,
        upper=constants["prior_upper"].values,
        drawn=DrawnBy(**json.loads(tree.attrs["drawn_by"])),
        observation=_observation(measured),
        settings=json.loads(tree.attrs["settings"]),
        model_error=errors_from_groups(tree),
        scatter=scatter_from_group(tree),
        warnings=tuple(json.loads(tree.attrs["warnings"])),
    )


def _complex(parts: Floats) -> Complexes:
    """(m,) of real and imaginary parts (2, m)."""
    return np.asarray(parts[0] + 1j * parts[1])


def _observation(group: Any) -> Observation:
    return Observation(
        frequency_hz=group["frequency_hz"].values,
        floors=tuple(str(name) for name in group["floor"].values),
        log_frf=group["log_frf"].values,
        noise_sd=group["noise_sd"].values,
        valid=group["valid"].values.astype(bool),
        phase=group["phase"].values if "phase" in group else None,
        coherence=group["coherence"].values if "coherence" in group else None,
        resolution_hz=float(group.attrs["resolution_hz"]) or None,
        scatter=group["scatter"].values if "scatter" in group else None,
        rotation=_complex(group["rotation"].values) if "rotation" in group else None,
        source=str(group.attrs["source"]),
        notes=tuple(json.loads(group.attrs["notes"])),
    )
