"""How fast stable-baselines3 learns on the batched environments, and how well what it learned drives."""
