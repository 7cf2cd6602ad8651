"""Mitsuba and Dr.Jit: backend choice, scene handle, channel contract, factorized integrator, G-buffer, denoising.

Start at `render.render_frame`. Importing this package loads no Mitsuba; select a variant first
(`backend.select_variant`), which loading a scene does where it was not done.
"""
