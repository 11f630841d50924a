"""What `swarm-mj doctor` looks at: packages, rendering, the machine."""
