"""What is fitted to what: how rows become a network's tensors, and its outputs an error, for each family."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ...terrain import OUTPUT_NAMES, FloatArray, Mode, TrackedVehicle
from ..network import NUMPY_NETWORK, DenseNetwork
from ..normalizer import Normalizer
from ..track_model import FEATURES, SIDES, Side, TrackState, track_force, track_state
from .preparation import whitening
from .training_config import TrainingConfig


class Objective(Protocol):
    """One family's way from rows to errors."""

    #: Inputs, hidden widths and outputs of the network.
    widths: tuple[int, ...]
    input_normalizer: Normalizer
    output_normalizer: Normalizer
    #: The artifact's feature map.
    feature_map: str
    #: Whether the network adds to what is near the truth already, and so starts with outputs of zero.
    corrects: bool

    def tensors(self, inputs: FloatArray, forces: FloatArray) -> tuple[Any, ...]:
        """Return float32 tensors, one row each, that :meth:`errors` takes."""

    def errors(self, module: Any, batch: Sequence[Any]) -> Any:
        """Return the errors of a batch, shape (rows, 3), each output over its scale."""

    def finished(self, network: DenseNetwork) -> DenseNetwork:
        """Return the trained network as the artifact holds it."""


def make_objective(
    config: TrainingConfig, vehicle: TrackedVehicle, mode: Mode, inputs: FloatArray, forces: FloatArray
) -> Objective:
    """Return the objective of a recipe, its scales fitted to training rows."""
    if config.family == "plain":
        return PlainObjective(config, inputs, forces)
    return StructuredObjective(config, vehicle, mode, inputs)


class PlainObjective:
    """Normalized forces from normalized interface columns, in whitened coordinates if the recipe says so."""

    feature_map = "interface"
    corrects = False

    def __init__(self, config: TrainingConfig, inputs: FloatArray, forces: FloatArray) -> None:
        self.input_normalizer, self.output_normalizer = Normalizer.fit(inputs), Normalizer.fit(forces)
        size = inputs.shape[1]
        self._coordinates = whitening(self.input_normalizer.normalize(inputs)) if config.whiten else np.eye(size)
        self.widths = (size, *config.hidden, len(OUTPUT_NAMES))

    def tensors(self, inputs: FloatArray, forces: FloatArray) -> tuple[Any, ...]:
        """Return normalized inputs and forces."""
        columns = self.input_normalizer.normalize(inputs) @ self._coordinates
        return _tensor(columns), _tensor(self.output_normalizer.normalize(forces))

    def errors(self, module: Any, batch: Sequence[Any]) -> Any:
        """Return predicted less given forces, each over its standard deviation."""
        inputs, targets = batch
        return module(inputs) - targets

    def finished(self, network: DenseNetwork) -> DenseNetwork:
        """Fold the coordinates into the first layer."""
        first, *others = network.weights
        return replace(network, weights=((self._coordinates @ first).astype(np.float32), *others))


class StructuredObjective:
    """What is left of the forces over the shear that the ground has to offer, from the features of both tracks.

    The available shear of a row is Σ S_i of both tracks; Qx and Qy are taken over it, Mz over it times L/4.
    """

    feature_map = "track"
    corrects = True

    def __init__(self, config: TrainingConfig, vehicle: TrackedVehicle, mode: Mode, inputs: FloatArray) -> None:
        self._vehicle, self._mode = vehicle, mode
        features = [self.state(inputs, side).features for side in SIDES]
        self.input_normalizer = Normalizer.fit(np.concatenate(features))
        outputs = 3 * vehicle.road_wheels
        self.output_normalizer = Normalizer(np.zeros(outputs), np.full(outputs, _OUTPUT_SCALE))
        self.widths = (FEATURES, *config.hidden, outputs)
        self._levers = np.array([1.0, 1.0, vehicle.contact_length / 4])

    def tensors(self, inputs: FloatArray, forces: FloatArray) -> tuple[Any, ...]:
        """Return features (n, 2, 10), element weights (n, 2, elements) and what the quadrature leaves (n, 3)."""
        states = {side: self.state(inputs, side) for side in SIDES}
        left = forces.copy()
        for side, state in states.items():
            left -= np.concatenate(track_force(NUMPY_NETWORK, self._vehicle, state, 0.0, side), axis=1)
        scale = self.scale(list(states.values()))
        features = np.stack([self.input_normalizer.normalize(state.features) for state in states.values()], axis=1)
        weights = np.stack([state.strengths * state.gate for state in states.values()], axis=1)
        weights *= _OUTPUT_SCALE / scale[:, None, :1]
        return _tensor(features), _tensor(weights), _tensor(left / scale)

    def state(self, inputs: FloatArray, side: Side) -> TrackState:
        """Return what one track's force is made of, for rows (n, d)."""
        return track_state(NUMPY_NETWORK, self._vehicle, self._mode, inputs, side)

    def scale(self, states: Sequence[TrackState]) -> FloatArray:
        """Return what the errors are over, shape (n, 3): 2 % of the available shear, for Mz times L/4."""
        shear = np.concatenate([state.strengths for state in states], axis=1).sum(axis=1, keepdims=True)
        scaled: FloatArray = shear * _ERROR_SCALE * self._levers
        return scaled

    def errors(self, module: Any, batch: Sequence[Any]) -> Any:
        """Return predicted less given forces over the available shear."""
        import torch

        features, weights, targets = batch
        vehicle, count = self._vehicle, self._vehicle.road_wheels
        along, across, moment = torch.split(module(features), count, dim=-1)
        arms = torch.tensor(vehicle.element_centers, dtype=torch.float32)
        fx, fy = (weights * along).sum(dim=-1), (weights * across).sum(dim=-1)
        mz = (weights * (arms * across + vehicle.element_length / 2 * moment)).sum(dim=-1) - vehicle.tread / 2 * fx
        (left_x, right_x), (left_y, right_y), (left_z, right_z) = (part.unbind(dim=-1) for part in (fx, fy, mz))
        predicted = torch.stack([left_x + right_x, left_y - right_y, (left_z - right_z) / self._levers[2]], dim=-1)
        return predicted - targets

    def finished(self, network: DenseNetwork) -> DenseNetwork:
        """Return the network as it is."""
        return network


# What the network adds to the quadrature is of this size, in parts of the strength; and so are the errors to begin with.
_OUTPUT_SCALE = 0.1
_ERROR_SCALE = 0.02


def _tensor(array: FloatArray) -> Any:
    import torch

    return torch.from_numpy(array.astype(np.float32))
