"""Models of a study: fitting, cross-validation, scores, comparison, cached results.

Begin with `study`: it divides the work into independent tasks by terrain and fold
(`crossval`, `models`), which `tasks` runs on processes or a cluster and `store` caches.
`break_away_fit` and `slip_risk` model the force at which a foot at rest slips.
"""
