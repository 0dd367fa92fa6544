"""Posterior samples on disk, in the layout of ArviZ InferenceData (netCDF)."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femupdate.arrays import Floats
from femupdate.atomic import atomic_path
from femupdate.errors import StudyError
from femupdate.measurement.observation import Observation
from femupdate.seeds import Seed


@dataclass(frozen=True)
class Posterior:
    """Equally weighted posterior draws.

    Attributes:
        names: p names of the stiffness factors.
        theta: (chains, draws, p); each chain is a run of the sampler of its own.
        zeta: (chains, draws) damping ratio, or None where the building's law is fixed.
        log_likelihood: (chains, draws).
        lower, upper: (p,) prior box.
        likelihood: "latent" or "exact".
        log_evidence: (chains,) for the exact likelihood where the sampler gives it, else None.
        observation: what it was drawn for.
        settings: of the sampler.
    """

    names: tuple[str, ...]
    theta: Floats
    zeta: Floats | None
    log_likelihood: Floats
    lower: Floats
    upper: Floats
    likelihood: str
    log_evidence: Floats | None
    observation: Observation
    settings: Mapping[str, Any]

    @property
    def samples(self) -> Floats:
        """All draws (chains x draws, p)."""
        return self.theta.reshape(-1, self.theta.shape[-1])

    @property
    def zeta_samples(self) -> Floats | None:
        """Damping ratios of all draws."""
        return None if self.zeta is None else self.zeta.reshape(-1)

    def thinned(self, count: int, seed: Seed) -> tuple[Floats, Floats | None]:
        """At most `count` draws of theta (count, p) and zeta (count,), without replacement."""
        rng = np.random.default_rng(seed)
        rows = rng.permutation(len(self.samples))[:count]
        zeta = self.zeta_samples
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
    if posterior.log_evidence is not None:
        stats["log_evidence"] = ("chain", posterior.log_evidence)
    floor_frequency = ("floor", "frequency_hz")
    grid = {"floor": list(observation.floors), "frequency_hz": observation.frequency_hz}
    measured: dict[str, Any] = {
        "log_frf": (floor_frequency, observation.log_frf),
        "noise_sd": (floor_frequency, observation.noise_sd),
        "valid": (floor_frequency, observation.valid.astype(np.int8)),
    }
    if observation.phase is not None:
        measured["phase"] = (floor_frequency, observation.phase)
    if observation.coherence is not None:
        measured["coherence"] = (floor_frequency, observation.coherence)
    if observation.scatter is not None:
        measured["scatter"] = (floor_frequency, observation.scatter)
    tree = xr.DataTree.from_dict(
        {
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
                    "prior_lower": ("parameter", posterior.lower),
                    "prior_upper": ("parameter", posterior.upper),
                },
                coords={"parameter": list(posterior.names)},
            ),
        }
    )
    tree.attrs = {
        "likelihood": posterior.likelihood,
        "settings": json.dumps(dict(posterior.settings)),
    }
    with atomic_path(path) as temporary:
        tree.to_netcdf(temporary, engine="h5netcdf")


def load_posterior(path: Path) -> Posterior:
    """Read what `save_posterior` wrote.

    Raises:
        StudyError: the file is missing or is not a posterior of femupdate.
    """
    import h5py
    import xarray as xr

    if not Path(path).exists():
        raise StudyError(f"there is no posterior {path}; run `femupdate calibrate` first")
    try:
        # h5netcdf complains on stderr about files that HDF5 refuses: let HDF5 see them first.
        h5py.File(path, "r").close()
        with xr.open_datatree(path, engine="h5netcdf") as tree:
            return _posterior(tree.load())
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
    return Posterior(
        tuple(str(name) for name in draws["parameter"].values),
        draws["theta"].values,
        draws["zeta"].values if "zeta" in draws else None,
        stats["lp"].values,
        constants["prior_lower"].values,
        constants["prior_upper"].values,
        str(tree.attrs["likelihood"]),
        stats["log_evidence"].values if "log_evidence" in stats else None,
        _observation(measured),
        json.loads(tree.attrs["settings"]),
    )


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
        source=str(group.attrs["source"]),
        notes=tuple(json.loads(group.attrs["notes"])),
    )
