"""What networks share that make an image of a frame from its direct light and its surfaces, pixel by pixel alike.

`frames` reads what they learn from, `camera_space` is how a camera sees it, `device_frames` has the same of a frame
that is being rendered, on the device. Channels have their names and units of the channel contract everywhere.
"""
