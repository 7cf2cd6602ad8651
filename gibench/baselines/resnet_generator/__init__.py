"""The generator of residual blocks that pix2pix is compared with (Johnson et al. 2016, Zhu et al. 2017)."""
