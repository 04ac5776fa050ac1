"""Running statistics of observations, frozen: what ``VecNormalize`` does to an observation, without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...surrogate.container import Tensors
from ...terrain import FloatArray, InvalidInputError

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv, VecNormalize

#: Key of the one row of an observation that is no dictionary.
ROW: Final = ""


@dataclass(frozen=True, eq=False)
class ObservationNormalizer:
    """Mean and variance of every part of an observation, by its key.

    Parameters
    ----------
    mean, variance : mapping of str to ndarray, shape (k,)
        By key of the observation; of one that is no dictionary, by the empty string.
    clip : float
        Bound of a normalized number.
    epsilon : float
        Added to the variance.

    Raises
    ------
    InvalidInputError
        If a number is not finite or a variance negative.
    """

    mean: Mapping[str, FloatArray]
    variance: Mapping[str, FloatArray]
    clip: float
    epsilon: float

    def __post_init__(self) -> None:
        for key, mean in self.mean.items():
            variance = self.variance[key]
            if mean.shape != variance.shape or not (np.isfinite(mean) & np.isfinite(variance) & (variance >= 0)).all():
                raise InvalidInputError(
                    f"statistics of observation {key!r} must be finite, with variances of at least 0"
                )
        if not (self.clip > 0 and self.epsilon > 0):
            raise InvalidInputError(f"clip and epsilon must be positive, got {self.clip} and {self.epsilon}")

    def __call__(self, observation: Any) -> Any:
        """Return the normalized observation, float32, of the layout that came."""
        if isinstance(observation, Mapping):
            return {key: self._normalize(key, part) if key in self.mean else part for key, part in observation.items()}
        return self._normalize(ROW, observation)

    def _normalize(self, key: str, part: Any) -> Any:
        deviation = np.sqrt(self.variance[key] + self.epsilon)
        return np.clip((part - self.mean[key]) / deviation, -self.clip, self.clip).astype(np.float32)

    def to_tensors(self) -> Tensors:
        """Return the statistics as named tensors."""
        both = (("mean", self.mean), ("variance", self.variance))
        return {f"normalizer.{name}.{key}": array for name, parts in both for key, array in parts.items()}

    def to_json(self) -> dict[str, Any]:
        """Return what :meth:`from_file` needs beside the tensors."""
        return {"keys": sorted(self.mean), "clip": self.clip, "epsilon": self.epsilon}

    @classmethod
    def from_file(cls, tensors: Tensors, content: Mapping[str, Any]) -> ObservationNormalizer:
        """Return the statistics that were written as tensors and JSON."""
        mean, variance = (
            {key: tensors[f"normalizer.{name}.{key}"] for key in content["keys"]} for name in ("mean", "variance")
        )
        return cls(mean, variance, float(content["clip"]), float(content["epsilon"]))

    @classmethod
    def from_vec_normalize(cls, wrapper: VecNormalize) -> ObservationNormalizer | None:
        """Return the statistics of a wrapper; None if it leaves observations as they are."""
        if not wrapper.norm_obs:
            return None
        found = wrapper.obs_rms if isinstance(wrapper.obs_rms, dict) else {ROW: wrapper.obs_rms}
        return cls(
            {key: np.array(part.mean, np.float64) for key, part in found.items()},
            {key: np.array(part.var, np.float64) for key, part in found.items()},
            float(wrapper.clip_obs),
            float(wrapper.epsilon),
        )

    def wrap(self, environment: VecEnv) -> VecNormalize:
        """Return a stable-baselines3 environment whose observations are normalized by these statistics, frozen."""
        from stable_baselines3.common.vec_env import VecNormalize

        keys = None if ROW in self.mean else sorted(self.mean)
        wrapper = VecNormalize(
            environment,
            training=False,
            norm_reward=False,
            clip_obs=self.clip,
            epsilon=self.epsilon,
            norm_obs_keys=keys,
        )
        for key, mean in self.mean.items():
            statistics = wrapper.obs_rms if key == ROW else wrapper.obs_rms[key]
            statistics.mean, statistics.var = mean.copy(), self.variance[key].copy()  # type: ignore[union-attr]
        return wrapper
