"""Still lifes: a few glossy and matt things and a metal ring on a ground or a table, under an environment alone.

The counterpart of the scene "Four Animals" of "Neural Free-Viewpoint Relighting for Glossy Indirect Illumination"
(Raghavan et al. 2023): glossy reflections of things in each other, and the caustics of a ring.
"""
