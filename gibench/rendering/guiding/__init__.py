"""Path guiding: which light to ask at a place and where to go on from there, learned once for a scene.

A grid of cells lies over the room. Each cell and each of the six directions that its surfaces may face holds two
discrete distributions: one over the lights, and one over directions (Müller et al. 2017, Vévoda et al. 2018). They are
learned from paths that start all over the room, and from looks around at what these have lit; they serve every path
that is traced in it afterwards.
"""
