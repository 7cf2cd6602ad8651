"""gibench: datasets for, and an honest comparison of, real-time global illumination.

Importing the package loads neither Mitsuba nor torch; the rooms of the house do so when they are used.
"""

__version__ = "0.1.0"
