"""pix2pix (Isola et al. 2017): images to images by a U-Net, with a judge."""
