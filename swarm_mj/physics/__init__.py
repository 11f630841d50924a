"""The physics (IV-A): the MJCF scene and the MuJoCo worlds that step it."""
