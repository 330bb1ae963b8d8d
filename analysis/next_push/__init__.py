"""The push that teaches most about a terrain, and when there are enough of them.

`records` is what a kept trial leaves for this, `aims` what a person can aim at and
what becomes of it, `knowledge` what the trials so far know
about and would know after another, `stopping` when that is enough for a target,
`advice` chooses among the pushes that a person can aim at. Begin with `advice`.
"""
