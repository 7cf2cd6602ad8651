"""What networks are trained for: pixels, features of other networks, and judges that learn along."""
