"""How is the block learned, trusted and shipped? Network, artifact, detector, and the backends made of them."""

from .artifact import FEATURE_MAPS, FORMAT_VERSION, Surrogate, shipped_names
from .backends import NativeSurrogate, TorchSurrogate
from .card import model_card
from .conformal import conformal_threshold, run_scores
from .detector import BoxMahalanobisDetector
from .export import export_c
from .guarded import GuardedSurrogate
from .network import (
    ACTIVATIONS,
    NUMPY_NETWORK,
    Activation,
    DenseNetwork,
    NetworkNamespace,
    casadi_network,
    random_network,
    torch_module,
    torch_network,
)
from .normalizer import Normalizer

__all__ = [
    "ACTIVATIONS",
    "FEATURE_MAPS",
    "FORMAT_VERSION",
    "NUMPY_NETWORK",
    "Activation",
    "BoxMahalanobisDetector",
    "DenseNetwork",
    "GuardedSurrogate",
    "NativeSurrogate",
    "NetworkNamespace",
    "Normalizer",
    "Surrogate",
    "TorchSurrogate",
    "casadi_network",
    "conformal_threshold",
    "export_c",
    "model_card",
    "random_network",
    "run_scores",
    "shipped_names",
    "torch_module",
    "torch_network",
]
