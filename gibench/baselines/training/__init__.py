"""Shared by every trained method: the loop, checkpoints, codes, losses, encodings, crops. Pure torch, no renderer.

A method writes a `Learner`, which owns its networks and makes its own steps; `train` makes as many of them as a
`Budget` allows, looks at a held-out error now and then, and gives back the best weights with the curve of that error.
See `gibench.baselines.training.loop`.
"""
