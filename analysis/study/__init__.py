"""Models of a study: fitted by name, cross-validated, scored, compared, kept on disk.

Begin with `study`: it makes independent tasks of terrain, fold and model (`crossval`,
`models`), which `tasks` runs on processes or a cluster and `store` keeps.
`break_away_fit` and `slip_risk` say what the ground gives before a foot at rest slips.
"""
