"""The paper's figures: ours and the published curves in one style, drawn without a display."""
