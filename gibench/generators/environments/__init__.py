"""Environment maps: those that ship, those of the user, and panoramas of generated rooms."""
