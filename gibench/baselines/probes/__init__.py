"""Light probes on a grid: maps of what the glossy surfaces around a point send towards it, shared by all methods.

`knobs` is what a method's card needs; `placement`, `baking` and `maps` do the work and load Mitsuba.
"""
