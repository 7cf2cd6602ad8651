"""Probes with more texels where they are needed (Rodriguez et al. 2020, section 4.2).

`resolution` says how many each direction needs, `quasi_harmonic` moves a mesh of directions so that it gets them,
`inversion` tells where the texels then look, and `warp` reads both maps inside of kernels.
"""
