"""Numbers as networks take them: positions and directions in more dimensions than they have."""
