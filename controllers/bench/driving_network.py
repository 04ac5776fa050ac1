"""A plain network that drives, trained while one waits: none of its size is shipped."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from ...surrogate import DenseNetwork, NativeSurrogate, torch_module
from .subjects import Subjects

_STEPS: Final = 2000
_BATCH: Final = 512
_LEARNING_RATE: Final = 1e-2


def driving_network(subjects: Subjects, hidden: tuple[int, ...], steps: int = _STEPS) -> NativeSurrogate:
    """Train a plain network on motions over asphalt, for two seconds and always alike; return it in C.

    It follows the physics closely enough for episodes of the usual kind. How good a network of its size becomes is
    another study's question.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    surrogate = subjects.plain(hidden)
    generator = np.random.default_rng(1)
    x, _ = subjects.training_rows(generator)
    module = torch_module(surrogate.network)
    import torch

    given = torch.from_numpy(surrogate.input_normalizer.normalize(x)).float()
    wanted = torch.from_numpy(surrogate.output_normalizer.normalize(subjects.physics((4, 2)).forces(x))).float()
    optimizer = torch.optim.Adam(module.parameters(), lr=_LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _LEARNING_RATE, steps)
    for _ in range(steps):
        chosen = torch.from_numpy(generator.integers(0, len(x), _BATCH))
        loss: Any = ((module(given[chosen]) - wanted[chosen]) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    trained = replace(surrogate, network=DenseNetwork.from_torch(module))
    return NativeSurrogate(subjects.vehicle, trained.mode, trained)
