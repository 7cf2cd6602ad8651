"""Where the noise of a frame is: its variance by depth, lobe, light and technique, and the worst paths."""
