"""Deep Shading (Nalbach et al. 2017): screen-space effects by a small U-shaped network."""
