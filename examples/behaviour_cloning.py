"""Record a policy's episodes as a Minari dataset, and clone the policy from the dataset alone.

python examples/behaviour_cloning.py
"""

import tempfile
from pathlib import Path

import minari
import numpy as np
import torch

from grouser.controllers import Recipe, TrainingPlan, evaluate, train_policy
from grouser.controllers.rl import record_dataset

torch.manual_seed(0)
torch.set_num_threads(1)

# A few seconds of training are enough to have something to clone.
recipe = Recipe.shipped("ppo", "path-tracking").changed(
    {"n_timesteps": 28_672, "n_envs": 16, "n_steps": 64, "batch_size": 256, "gamma": 0.9, "learning_rate": "lin_4e-3"}
)
expert = train_policy(TrainingPlan(recipe, {"backend": "native"})).policy
judged = expert.environment_spec(backend="physics")

with tempfile.TemporaryDirectory() as folder:
    path = record_dataset(expert, judged, "grouser/path-tracking/ppo-v0", episodes=10, root=Path(folder))
    dataset = minari.MinariDataset(path / "data")
    print("recorded on", dataset.storage.metadata["grouser"]["environment"]["backend"]["backend"])
    episodes = list(dataset.iterate_episodes())
    observations = torch.tensor(np.concatenate([episode.observations[:-1] for episode in episodes]))
    actions = torch.tensor(np.concatenate([episode.actions for episode in episodes]))

network = torch.nn.Sequential(
    torch.nn.Linear(observations.shape[1], 64), torch.nn.Tanh(),
    torch.nn.Linear(64, 64), torch.nn.Tanh(),
    torch.nn.Linear(64, actions.shape[1]),
)  # fmt: skip
optimizer = torch.optim.Adam(network.parameters(), lr=2e-3)
for _ in range(25):
    for batch in torch.split(torch.randperm(len(observations)), 256):
        loss = torch.nn.functional.mse_loss(network(observations[batch]), actions[batch])
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()


class Clone:
    """What an evaluation asks of a policy."""

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return the action in [-1, 1]²."""
        with torch.no_grad():
            action: np.ndarray = network(torch.as_tensor(observation)).numpy()
        clipped: np.ndarray = np.clip(action, -1.0, 1.0)
        return clipped


print(f"{len(observations)} steps, last loss {loss.item():.2g}")
for name, policy in (("expert", expert), ("clone", Clone())):
    found = evaluate(policy, judged, episodes=10, seed=100)
    print(f"{name:6s} return {found.return_mean:7.2f} ± {found.return_margin:.2f}")
