"""Geometry-Aware Feature Aggregation (Gai, Wang & Li): indirect light of rooms never seen, in screen space."""
