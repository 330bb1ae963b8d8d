"""One trial: what its file says first, when it ends, how good it is.

`header` writes what was known before the first cycle, `files` keeps what was recorded,
`quality` is the gate at the review.
"""
