"""Posteriors on disk: they come back, others can read them, and wrong files are named."""

from dataclasses import fields, replace

import h5py
import numpy as np
import pytest

from femupdate.errors import StudyError
from femupdate.inference import (
    DrawnBy,
    Parameter,
    Parameters,
    Posterior,
    load_posterior,
    save_posterior,
)
from femupdate.measurement import Observation

CHAINS, DRAWS, POINTS = 3, 25, 12
FACTORS = Parameters.uniform(("theta_1", "theta_2"), [0.3, 0.2], [3.0, 2.0])
SIZE = Parameter(name="mass@RF.size", kind="effect", lower=-0.1, upper=1.0, neutral=0.0, scale=0.3)
ZETA = Parameter(name="zeta", kind="damping", lower=0.01, upper=0.9)
PARAMETERS = FACTORS + Parameters((SIZE, ZETA))
KNOWN = FACTORS + Parameters((replace(ZETA, lower=0.05, upper=0.05),))


@pytest.fixture
def observation():
    rng = np.random.default_rng(0)
    shape = (2, POINTS)
    valid = rng.random(shape) < 0.8
    return Observation(
        frequency_hz=0.5 * np.arange(1, POINTS + 1),
        floors=("2F", "RF"),
        log_frf=np.where(valid, rng.normal(size=shape), np.nan),
        noise_sd=np.where(valid, 0.2, np.nan),
        valid=valid,
        phase=rng.uniform(-3.0, 3.0, shape),
        coherence=rng.random(shape),
        resolution_hz=0.3,
        source="shaking.csv",
        notes=("Two sensors averaged.", "ω up to 6 Hz; “as filed”."),
        between=rng.random(shape),
    )


@pytest.fixture
def posterior(observation):
    rng = np.random.default_rng(1)
    return Posterior(
        parameters=PARAMETERS,
        values=rng.random((CHAINS, DRAWS, 4)),
        log_likelihood=rng.normal(size=(CHAINS, DRAWS)),
        drawn=DrawnBy(
            likelihood="exact",
            way="importance sampling",
            chains=CHAINS,
            evaluations=8000,
            effective_sample_size=4321.5,
            log_evidence=-580.9,
            log_evidence_error=0.02,
        ),
        observation=observation,
        settings={"particles": 75, "seed": 3, "exact": True},
    )


def assert_same(one, other):
    assert type(one) is type(other)
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, field.name
            np.testing.assert_array_equal(a, b, err_msg=field.name)
        elif isinstance(a, Observation):
            assert_same(a, b)
        else:
            assert a == b, field.name


def test_round_trip(posterior, tmp_path):
    save_posterior(posterior, tmp_path / "new" / "posterior.nc")
    assert_same(load_posterior(tmp_path / "new" / "posterior.nc"), posterior)


def test_round_trip_of_the_least(posterior, observation, tmp_path):
    """Latent likelihood, fixed damping, an observation of magnitudes alone, one chain."""
    plain = replace(
        observation, phase=None, coherence=None, resolution_hz=None, notes=(), between=None
    )
    least = replace(
        posterior,
        parameters=KNOWN,
        values=np.concatenate([posterior.theta[:1, :, :2], np.full((1, DRAWS, 1), 0.05)], axis=2),
        log_likelihood=posterior.log_likelihood[:1],
        drawn=DrawnBy(likelihood="latent", way="tempered particles", chains=1, evaluations=3),
        observation=plain,
        settings={},
    )
    save_posterior(least, tmp_path / "p.nc")
    assert_same(load_posterior(tmp_path / "p.nc"), least)
    assert least.zeta_samples is None
    assert (least.zeta == 0.05).all()


def test_arviz_opens_it(posterior, tmp_path):
    az = pytest.importorskip("arviz")
    save_posterior(posterior, tmp_path / "p.nc")
    data = az.from_netcdf(tmp_path / "p.nc", engine="h5netcdf")
    groups = set(data.groups()) if callable(getattr(data, "groups", None)) else set(data.children)
    assert {"posterior", "sample_stats", "observed_data", "constant_data"} <= groups
    assert data["posterior"]["theta"].dims[:2] == ("chain", "draw")
    assert data["sample_stats"]["lp"].shape == (CHAINS, DRAWS)
    summary = az.summary(data, var_names=["theta"])
    assert summary.shape[0] == 3
    np.testing.assert_allclose(
        summary["mean"], posterior.samples.mean(0), atol=6e-4
    )  # three printed digits
    assert summary["r_hat"].between(0.9, 1.3).all()
    names = [str(name) for name in data["posterior"]["parameter"].values]
    assert names == list(posterior.names)


def test_thinned_draws_keep_their_damping_and_come_once(posterior):
    draws = posterior.thinned(40, seed=2)
    assert draws.shape == (40, 4)
    assert len(np.unique(draws[:, 0])) == 40
    found = posterior.parameters.split(draws)
    for one, ratio in zip(found.of_structure.numpy(), found.zeta, strict=True):
        row = int(np.flatnonzero((posterior.samples == one).all(1))[0])
        assert posterior.zeta_samples[row] == ratio
    np.testing.assert_array_equal(posterior.thinned(40, seed=2), draws)
    assert len(posterior.thinned(10_000, seed=0)) == CHAINS * DRAWS


@pytest.mark.parametrize(
    ("lacks", "has"), [("constant_data/prior_kind", ""), ("observed_data/between", "scatter")]
)
def test_a_posterior_of_an_earlier_version_is_refused(posterior, tmp_path, lacks, has):
    """It does not say what kinds its parameters are, or how runs differ whose noise is unlike."""
    save_posterior(posterior, tmp_path / "p.nc")
    with h5py.File(tmp_path / "p.nc", "a") as file:
        if has:
            file.move(lacks, lacks.replace("between", has))
        else:
            del file[lacks]
    assert "an earlier version wrote it" in one_sentence(tmp_path / "p.nc")


def one_sentence(path):
    with pytest.raises(StudyError) as caught:
        load_posterior(path)
    text = str(caught.value)
    assert "\n" not in text
    assert str(path) in text
    assert "femupdate calibrate" in text
    return text


@pytest.mark.parametrize("content", [b"", b"theta,zeta\n1,2\n", b"\x89HDF\r\n\x1a\n" + bytes(40)])
def test_a_file_that_is_no_netcdf(tmp_path, content):
    (tmp_path / "p.nc").write_bytes(content)
    assert "is not a posterior of femupdate" in one_sentence(tmp_path / "p.nc")


@pytest.mark.parametrize("share", [0.01, 0.3, 0.9, 0.999])
def test_a_file_cut_short(posterior, tmp_path, share):
    save_posterior(posterior, tmp_path / "p.nc")
    content = (tmp_path / "p.nc").read_bytes()
    (tmp_path / "p.nc").write_bytes(content[: int(share * len(content))])
    one_sentence(tmp_path / "p.nc")


@pytest.mark.parametrize(
    "missing",
    [
        "posterior",
        "posterior/theta",
        "posterior/zeta",
        "sample_stats/lp",
        "constant_data/prior_lower",
    ],
)
def test_a_posterior_that_lacks_something(posterior, tmp_path, missing):
    save_posterior(posterior, tmp_path / "p.nc")
    with h5py.File(tmp_path / "p.nc", "a") as file:
        del file[missing]
    one_sentence(tmp_path / "p.nc")


@pytest.mark.parametrize("damage", ["no settings", "no JSON", "invalid observation", "effect"])
def test_a_posterior_that_is_not_ours(posterior, tmp_path, damage):
    save_posterior(posterior, tmp_path / "p.nc")
    with h5py.File(tmp_path / "p.nc", "a") as file:
        if damage == "no settings":
            del file.attrs["settings"]
        elif damage == "effect":
            file["constant_data/prior_kind"][2] = "damping"
        elif damage == "no JSON":
            file.attrs["settings"] = "{"
        else:
            file["observed_data/valid"][...] = 1
    one_sentence(tmp_path / "p.nc")


def spoiled(posterior, what):
    values, lp = posterior.values.copy(), posterior.log_likelihood.copy()
    if what == "theta of NaN":
        values[0, 3, 0] = np.nan
    elif what == "theta of 1e6":
        values[0, 3, 0] = 1e6
    elif what == "zeta of 7":
        values[0, 0, -1] = 7.0
    elif what == "likelihood of NaN":
        lp[0, 0] = np.nan
    return replace(posterior, values=values, log_likelihood=lp)


@pytest.mark.parametrize("what", ["theta of NaN", "theta of 1e6", "zeta of 7", "likelihood of NaN"])
def test_draws_that_no_sampler_has_made(posterior, tmp_path, what):
    """The hash of such a file may be right: it is what someone recorded."""
    save_posterior(spoiled(posterior, what), tmp_path / "p.nc")
    with pytest.raises(StudyError, match=r"is not a posterior of femupdate \(.*run `femupdate cal"):
        load_posterior(tmp_path / "p.nc")
