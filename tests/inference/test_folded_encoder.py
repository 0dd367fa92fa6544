"""The folded parameter encoder against the module that it stands for."""

import pytest
import torch

from femupdate.inference.folded_encoder import FoldedEncoder
from femupdate.surrogate.network import Mvae, NetworkSizes, Visibility

SIZES = NetworkSizes(
    floors=3, points=20, parameters=4, latent=5, floor_features=6, width=16, parameter_width=24
)


@pytest.fixture
def mvae():
    torch.manual_seed(4)
    made = Mvae(SIZES).eval()
    made.lower, made.upper = torch.full((4,), 0.3), torch.tensor([2.0, 3.0, 4.0, 5.0])
    # As they start, half of the weights are zero and all norms plain.
    for parameter in made.parameter_encoder.parameters():
        torch.nn.init.normal_(parameter, mean=0.2, std=0.5)
    return made


@pytest.mark.parametrize(
    ("dtype", "tolerance"),
    # oneDNN's product knows float32 alone: float64 takes torch's own.
    [(torch.float32, 2e-4), (torch.float64, 1e-11)],
)
def test_it_is_the_module(mvae, dtype, tolerance):
    mvae = mvae.to(dtype)
    theta = mvae.lower + (mvae.upper - mvae.lower) * torch.rand(50, 4, dtype=dtype)
    seen = Visibility(
        torch.tensor([[1.0, 0.0, 1.0]], dtype=dtype), torch.tensor([[0.1, 0.8]], dtype=dtype)
    )
    with torch.inference_mode():
        expected = mvae.encode_parameters(theta, seen.expand(50))
        found = FoldedEncoder(mvae, seen)(theta)
    assert expected.mean.std(dim=0).min() > 0.1
    torch.testing.assert_close(found.mean, expected.mean, rtol=tolerance, atol=tolerance)
    torch.testing.assert_close(found.variance, expected.variance, rtol=tolerance, atol=1e-12)
