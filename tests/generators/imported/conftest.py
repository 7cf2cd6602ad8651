from gibench.rendering.backend import select_variant

# Before the tests of this folder are imported: what they test loads Dr.Jit, which must know by then where LLVM is.
select_variant("auto")
