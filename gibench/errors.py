"""The root of every error that gibench raises on purpose."""


class GibenchError(Exception):
    """Bad input or an environment that cannot do what was asked.

    The message is one line: what is wrong, where, and what to do. The commands print it without a traceback.
    Each room of the house derives its own named errors from this one.
    """
