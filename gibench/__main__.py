"""`python -m gibench`, the same as the command `gibench`."""

from gibench.cli import main

if __name__ == "__main__":
    main()
