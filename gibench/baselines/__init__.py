"""Every method that is scored: those of the papers and the classical ones, a folder a family."""
