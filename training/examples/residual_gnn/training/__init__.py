"""Training of residual policies: PPO on what every packet was worth."""
