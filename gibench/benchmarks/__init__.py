"""Tracks, the harness that runs methods on them, results, statistics and reports."""
