"""What several tests need: small exemplars and reproducible hypothesis runs."""

from __future__ import annotations

import pytest
import torch
from hypothesis import HealthCheck, settings

settings.register_profile(
    "suite",
    deadline=None,  # the machine's load is not a failure
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("suite")


# One thread: on tensors as small as these, a second one only waits, and on a busy machine for long.
torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def _seeded():
    torch.manual_seed(0)


@pytest.fixture
def make_exemplar():
    """An 8-bit picture with structure: sloped stripes and some noise, a different one per seed."""

    def make(channels=1, height=16, width=16, seed=0, dtype=torch.float32):
        generator = torch.Generator().manual_seed(seed)
        rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
        planes = [((rows * 2 + columns * (3 + c)) % (7 + c)) / 9 for c in range(channels)]
        noisy = torch.stack(planes) + torch.rand(channels, height, width, generator=generator) / 5
        return ((noisy.clamp(0, 1) * 255).round() / 255).to(dtype)

    return make
