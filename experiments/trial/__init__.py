"""One trial: what its file says first, when it ends, how good it is.

`files` writes what is known before the first cycle and keeps what was recorded,
`quality` is the gate at the review.
"""
