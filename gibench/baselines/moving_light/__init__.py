"""What networks share that predict the indirect light of one room under an area light that moves.

`measure` is what numbers of a room are divided by, `lit_frames` is direct light and surfaces of a frame that is being
rendered, on the device.
"""
