"""Light in Haar wavelets on the faces of a cubemap, of which the few that matter are kept."""
