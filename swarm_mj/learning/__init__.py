"""Training (III-C): stable-baselines3's PPO over batched missions."""
