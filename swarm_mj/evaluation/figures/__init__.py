"""The paper's figures (V), drawn from results beside the published curves."""
