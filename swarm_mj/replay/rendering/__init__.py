"""Pictures of the scene by MuJoCo's renderer, with or without a screen, and videos of them."""
