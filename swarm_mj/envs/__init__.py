"""Faces of the swarm for other people's libraries; each is a module that imports its own."""
