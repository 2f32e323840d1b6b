"""Studies: model, specification, analysis, asserted claim, plot. Each file is one claim."""
