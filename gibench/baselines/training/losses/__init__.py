"""Losses of networks: of pixels, of features of other networks, and of discriminators that learn along."""
