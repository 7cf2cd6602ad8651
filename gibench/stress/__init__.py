"""Hard cases: small scenes and numbers built to break things, each with an answer that is known beforehand.

`gibench stress` runs them and writes the table; `docs/stability.md` shows one. A case is a function that carries
`@case` (see `registry`) and yields a `Check` for every part of the system that it tries: an error, the bound that it
must keep, and where that bound comes from: theory, an independent implementation, or the statistics of the estimator.
A file holds the cases of one subject. Everything of the house but the commands may be imported here.
"""
