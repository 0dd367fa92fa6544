"""Trained surrogates on disk: what comes back, and files that are none."""

import json

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from femupdate.errors import SurrogateError
from femupdate.surrogate import Surrogate, SurrogateInfo, load_surrogate, save_surrogate


@pytest.fixture(scope="module")
def surrogate(trained):
    info = SurrogateInfo(
        building="two_story",
        mechanics_hash="ab12",
        floors=("2F", "RF"),
        noise_sd=0.2,
        version="0.1.0",
        settings={"samples": 2000, "training": {"epochs": 45}},
        metrics=trained[0].metrics,
    )
    return Surrogate(trained[0].average, info)


@pytest.fixture
def path(surrogate, tmp_path):
    save_surrogate(surrogate, tmp_path / "surrogate.safetensors")
    return tmp_path / "surrogate.safetensors"


def test_all_that_is_known_of_it_comes_back(surrogate, path):
    back = load_surrogate(path)
    assert back.info == surrogate.info
    assert back.mvae.sizes == surrogate.mvae.sizes
    assert not back.mvae.training


def test_weights_come_back_within_half_precision(surrogate, path):
    own, back = surrogate.mvae.state_dict(), load_surrogate(path).mvae.state_dict()
    assert own.keys() == back.keys()
    for name, value in own.items():
        assert back[name].dtype == torch.float32
        if name.startswith(("observation_encoder.", "x_")):
            # Eleven bits; below 6e-5 half precision has fewer.
            torch.testing.assert_close(back[name], value, rtol=2.0**-11, atol=1e-7)
        else:
            assert torch.equal(back[name], value), name


def one_sentence(path):
    with pytest.raises(SurrogateError) as caught:
        load_surrogate(path)
    text = str(caught.value)
    assert "\n" not in text
    assert f"{path} is not a trained surrogate" in text
    assert "run `femupdate train`" in text


@pytest.mark.parametrize("share", [0.0, 1e-4, 0.01, 0.5, 0.9999])
def test_a_file_cut_short(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    one_sentence(path)


def test_no_file_at_all(tmp_path):
    one_sentence(tmp_path / "surrogate.safetensors")
    one_sentence(tmp_path)


@pytest.mark.parametrize("content", [b"weights", bytes(1000), b"\xff" * 1000])
def test_a_file_of_something_else(path, content):
    path.write_bytes(content)
    one_sentence(path)


def rewritten(path, change):
    with safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["femupdate"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    metadata = change(header, tensors)
    save_file(tensors, path, metadata=metadata)


@pytest.mark.parametrize(
    "change",
    [
        lambda header, tensors: None,
        lambda header, tensors: {"femupdate": "{"},
        lambda header, tensors: {"femupdate": "[]"},
        lambda header, tensors: header.pop("sizes") and {"femupdate": json.dumps(header)},
        lambda header, tensors: header["sizes"].pop("floors") and {"femupdate": json.dumps(header)},
        lambda header, tensors: (
            header["sizes"].update(heads=2) or {"femupdate": json.dumps(header)}
        ),
        lambda header, tensors: (
            header["sizes"].update(width=50) or {"femupdate": json.dumps(header)}
        ),
        lambda header, tensors: header.pop("floors") and {"femupdate": json.dumps(header)},
        lambda header, tensors: header.update(mood=1) or {"femupdate": json.dumps(header)},
        lambda header, tensors: (
            header["sizes"].update(width=10**6) or {"femupdate": json.dumps(header)}
        ),
        lambda header, tensors: (
            header["sizes"].update(floor_features=10**9) or {"femupdate": json.dumps(header)}
        ),
        lambda header, tensors: (
            header["sizes"].update(blocks=10**9) or {"femupdate": json.dumps(header)}
        ),
        lambda header, tensors: {"femupdate": "[" * 100_000},
        lambda header, tensors: (
            tensors["bend.straight.weight"].fill_(float("nan")) is None
            or {"femupdate": json.dumps(header)}
        ),
        lambda header, tensors: tensors.pop("lower") is None or {"femupdate": json.dumps(header)},
    ],
    ids=[
        "weights of another program",
        "broken header",
        "header of another kind",
        "no sizes",
        "a size missing",
        "a size of the future",
        "another width",
        "no floors",
        "an entry of the future",
        "terabytes of weights",
        "terabytes of features",
        "a billion blocks",
        "a header without end",
        "weights of NaN",
        "a tensor missing",
    ],
)
def test_weights_that_do_not_fit_their_header(path, change):
    rewritten(path, change)
    one_sentence(path)
