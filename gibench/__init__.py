"""gibench: datasets for, and an honest comparison of, real-time global illumination.

Importing the package loads neither Mitsuba nor torch; the rooms of the house do so when they are used. It names the
LLVM library that Dr.Jit will load, so import it before Mitsuba.
"""

from gibench.llvm import name_packaged_llvm

__version__ = "0.1.0"

name_packaged_llvm()
del name_packaged_llvm
