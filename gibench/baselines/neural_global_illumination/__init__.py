"""Neural Global Illumination (Gao et al. 2022): indirect light of a room whose camera and area light move."""
