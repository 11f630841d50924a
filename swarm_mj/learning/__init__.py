"""Training (III-C): networks by stable-baselines3's PPO, indices by evolution."""
